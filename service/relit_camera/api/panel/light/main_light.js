// Where a place's light mainly comes from, and its colour: found in its thumbnail, which is seen from inside.

import { loadPicture } from "../pictures.js";
import { hexOfLinear } from "./colors.js";

const SIZE = [32, 16];
const POWER = 4; // so that the brightest parts decide
const SPREAD = Math.cos((25 * Math.PI) / 180); // what lies this near belongs to one light
const FRONT = { azimuth_deg: 0, elevation_deg: 25, color: "#ffffff" };

/** Direction (not turned) and colour of the main light of a stored environment; from the front where it is not known. */
export async function mainLight(environment) {
  if (environment === null || environment === "background") return FRONT;
  const texels = texelsOf(await pictureOf(environment));
  return texels.length ? brightest(texels) : FRONT;
}

/** An environment's thumbnail, or null. */
export async function pictureOf(environment) {
  const picture = new Image();
  if (!(await loadPicture(picture, `/api/v1/environments/${encodeURIComponent(environment)}/thumbnail.jpg`))) return null;
  await picture.decode();
  return picture;
}

/**
 * The light of a thumbnail from some directions: linear RGB, the direction `to` it (right in the camera's picture, up,
 * toward the camera), its `solid` angle. Right of the thumbnail's middle lies what is at the camera picture's left.
 */
export function texelsOf(picture) {
  if (!picture) return [];
  const [width, height] = SIZE;
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = SIZE;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(picture, 0, 0, width, height);
  const pixels = context.getImageData(0, 0, width, height).data;
  return Array.from({ length: width * height }, (_, index) => {
    const elevation = (0.5 - (Math.floor(index / width) + 0.5) / height) * Math.PI;
    const azimuth = (0.5 - ((index % width) + 0.5) / width) * 2 * Math.PI;
    const across = Math.cos(elevation);
    return {
      rgb: [0, 1, 2].map((channel) => (pixels[4 * index + channel] / 255) ** 2.2),
      to: [Math.sin(azimuth) * across, Math.sin(elevation), Math.cos(azimuth) * across],
      solid: ((2 * Math.PI * Math.PI) / (width * height)) * across,
    };
  });
}

/** The direction with the most light round it. */
function brightest(all) {
  const texels = all.map((texel) => ({ ...texel, weight: (texel.rgb.reduce((sum, value) => sum + value / 3, 0)) ** POWER * texel.solid }));
  const near = (one) => texels.filter(({ to }) => to[0] * one.to[0] + to[1] * one.to[1] + to[2] * one.to[2] > SPREAD);
  const light = (some) => some.reduce((sum, { weight }) => sum + weight, 0);
  const best = texels.map(near).reduce((most, some) => (light(some) > light(most) ? some : most));
  const mean = (field) => [0, 1, 2].map((axis) => best.reduce((sum, texel) => sum + texel.weight * texel[field][axis], 0));
  const [right, up, front] = mean("to");
  const length = Math.hypot(right, up, front);
  if (length < 1e-9) return FRONT;
  return {
    azimuth_deg: (Math.atan2(right, front) * 180) / Math.PI,
    elevation_deg: (Math.asin(up / length) * 180) / Math.PI,
    color: hexOfLinear(mean("rgb")),
  };
}
