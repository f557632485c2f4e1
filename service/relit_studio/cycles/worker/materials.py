"""Materials of a person. The constants were chosen by looking at renders."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from relit_studio.cycles.worker.nodes import Nodes, Socket

Color = list[float]
_SHADE = 0.07
"""Melanin that a strand's shade of 1 adds."""
_GRAY_MELANIN = 0.05


def build_material(name: str, description: Mapping[str, Any]) -> Any:
    """A new material; `description` holds its `kind` and that kind's arguments."""
    arguments = dict(description)
    return _KINDS[arguments.pop("kind")](Nodes(name), **arguments)


def _skin(
    nodes: Nodes,
    albedo: str,
    pores: str,
    scalp_shade: float,
    relief: float,
    gloss: float = 0.0,
    folds: str = "",
    age: float = 0.0,
) -> Any:
    """Skin: photographed albedo with subsurface scattering, oily by a mesh attribute, moist on the lips."""
    lips, oil, scalp = (nodes.attribute(name) for name in ("lips", "oil", "scalp"))
    where = nodes.position()
    colour = nodes.mix_color(
        nodes.math("MULTIPLY", scalp, scalp_shade), nodes.picture(albedo), [0.12, 0.09, 0.08], "MULTIPLY"
    )
    cells = nodes.add("TexVoronoi", {"Vector": where, "Scale": 26.0}, feature="SMOOTH_F1").outputs["Distance"]
    normal = nodes.add("Bump", {"Strength": 0.35, "Distance": 0.012, "Height": cells}).outputs[0]
    height = nodes.picture(pores, linear=True)
    normal = nodes.add(
        "Bump", {"Strength": min(relief, 1.0), "Distance": 0.14 * max(relief, 1.0), "Height": height, "Normal": normal}
    ).outputs[0]
    if age:
        height = nodes.picture(folds, linear=True)
        normal = nodes.add("Bump", {"Strength": age, "Distance": 0.16, "Height": height, "Normal": normal}).outputs[0]
    # The lips' upright creases: without them a hard lamp makes one white streak.
    squeeze = nodes.add("Mapping", {"Vector": where, "Scale": (1.0, 0.25, 0.22)}).outputs[0]
    creases = nodes.add("TexNoise", {"Vector": squeeze, "Scale": 9.0, "Detail": 3.0}).outputs[0]
    depth = nodes.math("MULTIPLY", lips, 0.8)
    normal = nodes.add("Bump", {"Strength": depth, "Distance": 0.09, "Height": creases, "Normal": normal}).outputs[0]
    blotches = nodes.add("TexNoise", {"Vector": where, "Scale": 9.0, "Detail": 4.0}).outputs[0]
    shader = nodes.add(
        "BsdfPrincipled",
        {
            "Base Color": colour,
            "Subsurface Weight": 1.0,
            "Subsurface Scale": 0.16,
            "Subsurface Radius": (1.0, 0.42, 0.24),
            "Roughness": nodes.scaled_sum(0.42 - 0.14 * gloss, (blotches, 0.16), (oil, -0.07), (lips, -0.02)),
            "IOR": 1.42,
            "Specular IOR Level": nodes.scaled_sum(0.42, (lips, -0.10)),
            "Coat Weight": nodes.scaled_sum(0.0, (lips, 0.07), (oil, 0.10 + 0.12 * gloss)),
            "Coat Roughness": nodes.scaled_sum(0.24, (lips, 0.08)),
            "Coat IOR": 1.4,
            "Normal": normal,
        },
        subsurface_method="RANDOM_WALK",
    )
    return nodes.finish(shader.outputs[0])


def _plain(nodes: Nodes, colour: Color, roughness: float = 0.5, scattering: float = 0.0, metallic: float = 0.0) -> Any:
    shader = nodes.add(
        "BsdfPrincipled",
        {
            "Base Color": colour,
            "Roughness": roughness,
            "Metallic": metallic,
            "Subsurface Weight": scattering,
            "Subsurface Radius": (1.0, 0.4, 0.3),
            "Subsurface Scale": 0.15,
        },
    )
    return nodes.finish(shader.outputs[0])


def _painted(nodes: Nodes) -> Any:
    """Diffuse base with GGX gloss, from the vertex attributes red, green, blue, f0 and alpha (GGX width)."""
    red, green, blue, f0, alpha = (nodes.attribute(name) for name in ("red", "green", "blue", "f0", "alpha"))
    colour = nodes.add("CombineColor", {"Red": red, "Green": green, "Blue": blue}).outputs[0]
    root = nodes.math("SQRT", f0, 0.0)
    index = nodes.math("DIVIDE", nodes.math("ADD", 1.0, root), nodes.math("SUBTRACT", 1.0, root))
    shader = nodes.add(
        "BsdfPrincipled", {"Base Color": colour, "IOR": index, "Roughness": nodes.math("SQRT", alpha, 0.0)}
    )
    return nodes.finish(shader.outputs[0])


def _iris(nodes: Nodes, picture: str) -> Any:
    inputs: dict[str | int, Any] = {"Base Color": nodes.picture(picture), "Roughness": 0.4, "Specular IOR Level": 0.2}
    return nodes.finish(nodes.add("BsdfPrincipled", inputs).outputs[0])


def _cornea(nodes: Nodes, picture: str, limbus_cm: float) -> Any:
    """The eyeball's outer shell: wet sclera, and over the iris a clear film that only reflects."""
    sclera = nodes.add(
        "BsdfPrincipled",
        {
            "Base Color": nodes.picture(picture),
            "Roughness": 0.25,
            "Subsurface Weight": 0.6,
            "Subsurface Radius": (1.0, 0.6, 0.5),
            "Subsurface Scale": 0.08,
            "Coat Weight": 1.0,
            "Coat Roughness": 0.04,
            "Coat IOR": 1.38,
        },
    ).outputs[0]
    radius = nodes.attribute("eccentricity")
    ramp = nodes.add("MapRange", {"Value": radius, "From Min": limbus_cm - 0.06, "From Max": limbus_cm + 0.05})
    # The real cornea bends light onto the iris; here the shell's rim would shade it: it lets all light in.
    opaque = nodes.math("SUBTRACT", 1.0, nodes.add("LightPath").outputs["Is Shadow Ray"])
    fraction = nodes.math("MULTIPLY", ramp.outputs[0], opaque)
    return nodes.finish(nodes.mix_shader(fraction, _film(nodes, 1.62, 0.06), sclera))


def _wet(nodes: Nodes) -> Any:
    return nodes.finish(_film(nodes, 1.36, 0.05))


def _lens(nodes: Nodes) -> Any:
    """Thin coated glass: no refraction, little reflection."""
    return nodes.finish(_film(nodes, 1.16, 0.015))


def _film(nodes: Nodes, index: float, roughness: float) -> Socket:
    """Clear film without refraction, so without noise; it reflects Fresnel's fraction."""
    fresnel = nodes.add("Fresnel", {"IOR": index}).outputs[0]
    clear = nodes.add("BsdfTransparent").outputs[0]
    gloss = nodes.add("BsdfAnisotropic", {"Roughness": roughness}).outputs[0]
    return nodes.mix_shader(fresnel, clear, gloss)


def _lid_shade(nodes: Nodes, colour: Color) -> Any:
    """Colored transparency where the lids shade the eyeball."""
    tint = nodes.mix_color(nodes.attribute("edge"), [1.0, 1.0, 1.0], colour)
    return nodes.finish(nodes.add("BsdfTransparent", {"Color": tint}).outputs[0])


def _cloth(nodes: Nodes, colour: Color) -> Any:
    where = nodes.position()
    folds = nodes.add("TexNoise", {"Vector": where, "Scale": 0.28, "Detail": 2.0}).outputs[0]
    knit = nodes.add("TexNoise", {"Vector": where, "Scale": 14.0, "Detail": 6.0}).outputs[0]
    weave = nodes.add("TexWave", {"Vector": where, "Scale": 7.0, "Distortion": 0.6}).outputs[0]
    normal: dict[str | int, Any] = {}
    for height, strength, distance in ((folds, 0.4, 0.7), (knit, 0.3, 0.02), (weave, 0.25, 0.05)):
        bump = nodes.add("Bump", {"Strength": strength, "Distance": distance, "Height": height, **normal})
        normal = {"Normal": bump.outputs[0]}
    shader = nodes.add(
        "BsdfPrincipled",
        {
            "Base Color": colour,
            "Roughness": 0.85,
            "Sheen Weight": 0.35,
            "Sheen Roughness": 0.4,
            "Specular IOR Level": 0.2,
            **normal,
        },
    )
    return nodes.finish(shader.outputs[0])


def _hair(nodes: Nodes, melanin: float, redness: float, roughness: float = 0.26, grey: float = 0.0) -> Any:
    """Hair of the given pigments; the fraction `grey` of the strands has almost none."""
    shader = nodes.add("BsdfHairPrincipled", model="CHIANG", parametrization="MELANIN")
    pigment = nodes.scaled_sum(melanin, (nodes.attribute("shade"), _SHADE))
    if grey:
        colored = nodes.math("GREATER_THAN", nodes.add("HairInfo").outputs["Random"], grey)
        pigment = nodes.scaled_sum(_GRAY_MELANIN, (nodes.math("MULTIPLY", pigment, colored), 1.0))
    values = {
        "Melanin": pigment,
        "Melanin Redness": redness,
        "Roughness": roughness,
        "Radial Roughness": 0.45,
        "Coat": 0.1,
        "Random Color": 0.25,
        "Random Roughness": 0.2,
    }
    for name, value in values.items():
        nodes.connect(value, shader.inputs[name])
    return nodes.finish(shader.outputs[0])


_KINDS: dict[str, Callable[..., Any]] = {
    "skin": _skin,
    "plain": _plain,
    "painted": _painted,
    "iris": _iris,
    "cornea": _cornea,
    "wet": _wet,
    "lens": _lens,
    "lid_shade": _lid_shade,
    "cloth": _cloth,
    "hair": _hair,
}
