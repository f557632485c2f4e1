// The looks as tiles: each is a small picture of a head in its light, and is applied by a click.

import { make, setAttribute } from "../widgets.js";
import { backgroundToMatch, keepsBackground } from "../library/background.js";
import { change, onScene } from "../stage/scene.js";
import { linearOfHex } from "./colors.js";
import { LOOKS, standingLook } from "./looks.js";
import { pictureOf, texelsOf } from "./main_light.js";
import { drawBehind, drawHead, lampLight, placeLight } from "./portrait.js";

const SIZE = [240, 150];
/** What stands for a background of one's own: evening sky at the left, dusk at the right. */
const OWN = { sides: ["#e8a05f", "#3c6ea0"], elevation_deg: 10, size_deg: 90, intensity: 0.8 };

/** Draws a look: a head in its light, before its background. */
async function draw(canvas, look) {
  [canvas.width, canvas.height] = SIZE;
  const { environment, lamps, yaw_deg: yaw } = look.lighting;
  const context = canvas.getContext("2d");
  const lights = lamps.map(lampLight);
  if (look.background === null) {
    const sky = context.createLinearGradient(0, 0, SIZE[0], 0);
    OWN.sides.forEach((color, side) => {
      sky.addColorStop(side, color);
      lights.push(lampLight({ ...OWN, azimuth_deg: side ? 70 : -70, color: linearOfHex(color) }));
    });
    context.fillStyle = sky;
  } else {
    context.fillStyle = look.background.color ?? "#222";
  }
  context.fillRect(0, 0, ...SIZE);
  const behind = look.background?.kind === "image" ? look.background.image : look.background?.kind === "environment" ? environment : null;
  const picture = behind && (await pictureOf(behind));
  if (picture) drawBehind(canvas, picture, behind === environment ? yaw : 0);
  drawHead(canvas, lights, picture && behind === environment ? placeLight(texelsOf(picture), yaw) : null);
}

function apply(look, now) {
  const background = look.background ?? backgroundToMatch(now);
  // What is behind stays where that was asked for, unless the look is of the background itself.
  change({ lighting: look.lighting, ...(look.background && keepsBackground() ? {} : { background }) });
}

let shown = null;
const tiles = LOOKS.map((look) => {
  const picture = make("canvas", { className: "portrait", "aria-hidden": "true" });
  draw(picture, look);
  const face = make("span", { className: "face" }, picture);
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
