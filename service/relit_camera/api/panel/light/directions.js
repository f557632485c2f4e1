// Directions of light, drawn on the ball: the camera's own direction is its middle, its ring is a quarter turn from
// there, and what comes from behind the person lies in a band outside the ring.

const BEHIND_BAND = 0.2; // the width of the band, in radii of the ring

/** An angle in −180…180. */
export function wrap(angle) {
  return ((((angle + 180) % 360) + 360) % 360) - 180;
}

export function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}

const radians = (degrees) => (degrees * Math.PI) / 180;
const degreesOf = (angle) => (angle * 180) / Math.PI;

/**
 * Where a direction lies on the ball: x to the right and y downward, in radii of the ring; and whether it is behind.
 * Azimuth 90 is the picture's right, which a mirror shows at the left.
 */
export function pointOf(azimuthDeg, elevationDeg, mirrored) {
  const [azimuth, elevation] = [radians(azimuthDeg), radians(elevationDeg)];
  const right = Math.sin(azimuth) * Math.cos(elevation);
  const up = Math.sin(elevation);
  const angle = degreesOf(Math.acos(clamp(Math.cos(azimuth) * Math.cos(elevation), -1, 1)));
  const across = Math.hypot(right, up);
  const [x, y] = across < 1e-6 ? [0, angle > 90 ? 1 : 0] : [right / across, up / across];
  const radius = angle <= 90 ? angle / 90 : 1 + ((angle - 90) / 90) * BEHIND_BAND;
  return { x: (mirrored ? -x : x) * radius, y: -y * radius, behind: angle > 90.5 };
}

/** The direction of a point on the ball, in whole degrees; points outside it are those on its edge. */
export function directionOf(x, y, mirrored) {
  const radius = Math.min(Math.hypot(x, y), 1 + BEHIND_BAND);
  const angle = radians(radius <= 1 ? radius * 90 : 90 + ((radius - 1) / BEHIND_BAND) * 90);
  const across = Math.hypot(x, y) || 1;
  const right = (Math.sin(angle) * (mirrored ? -x : x)) / across;
  const up = (Math.sin(angle) * -y) / across;
  return {
    azimuth_deg: Math.round(degreesOf(Math.atan2(right, Math.cos(angle)))),
    elevation_deg: Math.round(degreesOf(Math.asin(clamp(up, -1, 1)))),
  };
}

/** A direction in words, as the preview shows it: "45 degrees left, 30 up". */
export function directionWords(azimuthDeg, elevationDeg, mirrored) {
  const azimuth = Math.round(wrap(azimuthDeg)) * (mirrored ? -1 : 1);
  const elevation = Math.round(elevationDeg);
  const turned = Math.abs(azimuth);
  const side = turned === 0 ? "in front" : turned === 180 ? "behind" : `${turned} degrees ${azimuth > 0 ? "right" : "left"}`;
  return `${side}, ${elevation === 0 ? "level" : `${Math.abs(elevation)} ${elevation > 0 ? "up" : "down"}`}`;
}
