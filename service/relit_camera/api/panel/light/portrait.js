// A small picture of what a light does: a plain head of clay, lit by lamps and by the light of a place.

import { linearOfKelvin } from "./colors.js";

const ALBEDO = [0.62, 0.56, 0.52];
const WHITE = 0.8; // what the brightest parts are drawn as, linear
const BLUR = 5; // pixels
const EDGE = 1.2; // pixels over which an edge fades
/** Ellipsoids, in tenths of the picture's height: middle (from the picture's middle, up, toward the camera), radii. */
const PARTS = [
  { middle: [0, -7.4, -1.2], radii: [5.2, 3.6, 2.2] },
  { middle: [0, -3.4, -0.6], radii: [1.15, 2.6, 1.2] },
  { middle: [0, 0.35, 0], radii: [2.25, 3.0, 2.5] },
];
const SHIFT = 0.4; // the whole stands this much above the picture's middle

const radians = (degrees) => (degrees * Math.PI) / 180;
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const encode = (value) => 255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);

/** A lamp as light: the direction to it (right in the camera's picture, up, toward the camera), colour, softness 0 to 1. */
export function lampLight({ azimuth_deg, elevation_deg, size_deg, kelvin, color, intensity }) {
  const [azimuth, elevation] = [radians(azimuth_deg), radians(elevation_deg)];
  return {
    to: [Math.sin(azimuth) * Math.cos(elevation), Math.sin(elevation), Math.cos(azimuth) * Math.cos(elevation)],
    rgb: (color ?? linearOfKelvin(kelvin)).map((value) => value * intensity),
    soft: Math.min(1, size_deg / 180),
  };
}

/** Light of a whole place, turned by `yaw`: the coefficients of a constant and of the three axes. */
export function placeLight(texels, yawDeg = 0) {
  const [sin, cos] = [Math.sin(radians(yawDeg)), Math.cos(radians(yawDeg))];
  const light = [0, 1, 2, 3].map(() => [0, 0, 0]);
  for (const { rgb, to: [x, y, z], solid } of texels) {
    const basis = [1 / 4, (x * cos + z * sin) / 2, y / 2, (z * cos - x * sin) / 2]; // of irradiance: Ramamoorthi 2001
    basis.forEach((weight, index) => rgb.forEach((value, channel) => { light[index][channel] += (value * weight * solid) / Math.PI; }));
  }
  return light;
}

/** Light that a surface gets from everywhere. */
function received(normal, lamps, place) {
  const sum = [0, 1, 2].map((channel) => (place ? Math.max(0, place[0][channel] + dot(normal, place.slice(1).map((axis) => axis[channel]))) : 0.012));
  for (const { to, rgb, soft } of lamps) {
    const share = Math.max(0, (dot(normal, to) + soft) / (1 + soft));
    for (const channel of [0, 1, 2]) sum[channel] += rgb[channel] * share * (soft ? share ** soft : 1);
  }
  return sum;
}

/** The surface at a point: its normal, how near it is, and how much of the pixel it covers. */
function surface(x, y, unit) {
  let found = null;
  for (const { middle, radii } of PARTS) {
    const [u, v] = [(x - middle[0]) / radii[0], (y - middle[1]) / radii[1]];
    const square = u * u + v * v;
    const rim = (1 - Math.sqrt(square)) * Math.min(radii[0], radii[1]) * unit; // pixels inside the edge
    if (rim <= -EDGE / 2) continue;
    const w = Math.sqrt(Math.max(0, 1 - square));
    const near = middle[2] + w * radii[2];
    const cover = Math.min(1, rim / EDGE + 0.5);
    if (found && (near < found.near || cover < 1)) {
      found.cover = Math.max(found.cover, cover);
      continue;
    }
    const normal = [u / radii[0], v / radii[1], w / radii[2]];
    const length = Math.hypot(...normal) || 1;
    found = { near, cover: Math.max(cover, found?.cover ?? 0), normal: normal.map((value) => value / length) };
  }
  return found;
}

/** Draws the head over what the canvas has, lit by `lamps` (of `lampLight`) and `place` (of `placeLight`, or null). */
export function drawHead(canvas, lamps, place) {
  const { width, height } = canvas;
  const unit = height / 10;
  const points = [];
  for (let index = 0; index < width * height; index++) {
    const x = ((index % width) + 0.5 - width / 2) / unit;
    const y = (height / 2 - Math.floor(index / width) - 0.5) / unit - SHIFT;
    const at = surface(x, y, unit);
    if (at) points.push({ index, cover: at.cover, rgb: received(at.normal, lamps, place).map((value, channel) => value * ALBEDO[channel]) });
  }
  const brightest = points.map(({ rgb }) => Math.max(...rgb)).sort((a, b) => a - b)[Math.floor(points.length * 0.97)];
  const context = canvas.getContext("2d");
  const head = context.createImageData(width, height);
  for (const { index, cover, rgb } of points) {
    rgb.forEach((value, channel) => { head.data[4 * index + channel] = encode(Math.min(1, (value * WHITE) / brightest)); });
    head.data[4 * index + 3] = 255 * cover;
  }
  const layer = new OffscreenCanvas(width, height);
  layer.getContext("2d").putImageData(head, 0, 0);
  context.drawImage(layer, 0, 0);
}

/** Fills the canvas with what of a place is behind the person, turned by `yaw`, out of focus. */
export function drawBehind(canvas, picture, yawDeg = 0) {
  const { width, height } = canvas;
  const sharp = new OffscreenCanvas(width, height);
  const scale = (3 * width) / picture.naturalWidth; // a third of the way round is seen
  const whole = picture.naturalWidth * scale;
  const left = width / 2 - (yawDeg / 360) * whole; // what is straight behind lies at the thumbnail's sides
  for (const turn of [-1, 0]) {
    sharp.getContext("2d").drawImage(picture, left + turn * whole, (height - picture.naturalHeight * scale) / 2, whole, picture.naturalHeight * scale);
  }
  const context = canvas.getContext("2d");
  context.filter = `blur(${BLUR}px)`;
  // Larger than the canvas, whose edges would else be blurred with nothing
  context.drawImage(sharp, -2 * BLUR, -2 * BLUR, width + 4 * BLUR, height + 4 * BLUR);
  context.filter = "none";
}
