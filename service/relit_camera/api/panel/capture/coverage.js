// A ball with a dot for each direction of light that was filmed.

const SVG = "http://www.w3.org/2000/svg";
const RADIUS = 100;

function draw(tag, attributes) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

/**
 * Draws unit vectors [x right, y up, z to the camera] over the whole sphere, as the camera sees it: areas keep their
 * size (Lambert's azimuthal projection), the middle is at the camera, the inner circle at a right angle, the outer one
 * behind the head.
 */
export function coverageBall(lights, words) {
  const svg = draw("svg", { id: "coverage", viewBox: "-104 -104 208 208", role: "img", "aria-label": words });
  svg.append(
    draw("circle", { class: "behind", r: RADIUS }),
    draw("circle", { class: "front", r: RADIUS / Math.SQRT2 }),
    draw("ellipse", { class: "head", rx: 9, ry: 12 }),
  );
  for (const [x, y, z] of lights) {
    const scale = RADIUS / Math.sqrt(2 * Math.max(1 + z, 1e-6));
    svg.append(draw("circle", { class: "light", cx: (x * scale).toFixed(1), cy: (-y * scale).toFixed(1), r: 2.6 }));
  }
  return svg;
}
