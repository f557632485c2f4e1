// The looks as tiles: each shows where its lamps stand and in what colour, and is applied by a click.

import { make, setAttribute } from "../widgets.js";
import { backgroundToMatch, keepsBackground } from "../library/background.js";
import { loadPicture } from "../pictures.js";
import { change, onScene } from "../stage/scene.js";
import { lampHex } from "./colors.js";
import { pointOf } from "./directions.js";
import { LOOKS, standingLook } from "./looks.js";

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 96;
const HEIGHT = 60;
const RADIUS = [34, 24];

function svg(tag, attributes) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

/** The ball in small, mirrored as the preview is at first: a head, and the lamps round it. */
function diagram(look) {
  const picture = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "diagram", "aria-hidden": "true" });
  const [middleX, middleY] = [WIDTH / 2, HEIGHT / 2];
  if (look.background?.color) picture.append(svg("rect", { width: WIDTH, height: HEIGHT, fill: look.background.color }));
  picture.append(svg("path", { class: "bust", d: "M48 14c8 0 12 6 12 13s-4 15-12 15-12-8-12-15 4-13 12-13zM22 60c2-11 12-15 26-15s24 4 26 15z" }));
  for (const lamp of look.lighting.lamps) {
    const { x, y, behind } = pointOf(lamp.azimuth_deg, lamp.elevation_deg, true);
    const at = { cx: middleX + x * RADIUS[0], cy: middleY + y * RADIUS[1] };
    picture.append(svg("circle", { ...at, r: 4 + lamp.size_deg / 8, fill: lampHex(lamp), opacity: 0.3 }));
    picture.append(svg("circle", { ...at, r: 4, ...(behind ? { fill: "none", stroke: lampHex(lamp), "stroke-width": 2 } : { fill: lampHex(lamp) }) }));
  }
  return picture;
}

function apply(look, now) {
  const background = look.background ?? backgroundToMatch(now);
  // What is behind stays where that was asked for, unless the look is of the background itself.
  change({ lighting: look.lighting, ...(look.background && keepsBackground() ? {} : { background }) });
}

let shown = null;
const tiles = LOOKS.map((look) => {
  const face = make("span", { className: "face" });
  if (look.lighting.environment && look.lighting.environment !== "background") {
    const place = make("img", { alt: "" });
    loadPicture(place, `/api/v1/environments/${look.lighting.environment}/thumbnail.jpg`);
    face.append(place);
  }
  face.append(diagram(look));
  const button = make("button", { type: "button", "aria-pressed": "false" }, face, make("span", { className: "name" }, look.name));
  button.onclick = () => shown && apply(look, shown);
  document.getElementById("looks").append(make("div", { className: "tile" }, button));
  return { look, button };
});
onScene((now) => {
  shown = now;
  const stands = standingLook(now);
  for (const { look, button } of tiles) setAttribute(button, "aria-pressed", look === stands);
});
