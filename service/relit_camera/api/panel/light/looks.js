// Looks of one click: what each consists of. Azimuth 90 is the picture's right, which a mirrored preview shows left.

/** What a look leaves as it is by itself: not turned, automatic exposure. */
export const UNTURNED = {
  yaw_deg: 0, pitch_deg: 0, roll_deg: 0, exposure_ev: 0, saturation: 1,
  face_gain_ev: 0, background_gain_ev: 0, blend: 1, split: 0,
};
const PLACE = { kind: "environment" };

const look = (name, lighting, background) =>
  Object.freeze({ name, lighting: Object.freeze({ ...UNTURNED, lamps: [], ...lighting }), background });

/** name, lighting, background; a background of null is the one that lights: a picture of one's own. */
export const LOOKS = Object.freeze([
  look("Key light", {
    environment: null,
    lamps: [
      { name: "Key", azimuth_deg: 40, elevation_deg: 32, size_deg: 40, kelvin: 5200, intensity: 0.95 },
      { name: "Fill", azimuth_deg: -55, elevation_deg: 5, size_deg: 90, kelvin: 5800, intensity: 0.22 },
      { name: "Rim", azimuth_deg: -150, elevation_deg: 35, size_deg: 20, kelvin: 6500, intensity: 0.8 },
    ],
  }, { kind: "color", color: "#26282b" }),
  look("Window", {
    environment: "window", yaw_deg: 30, exposure_ev: -0.3,
    lamps: [{ name: "Daylight", azimuth_deg: -75, elevation_deg: 12, size_deg: 50, kelvin: 6200, intensity: 0.7 }],
  }, PLACE),
  look("Rembrandt", {
    environment: null,
    lamps: [
      { name: "Key", azimuth_deg: -55, elevation_deg: 45, size_deg: 12, kelvin: 3600, intensity: 1.25 },
      { name: "Fill", azimuth_deg: 60, elevation_deg: 0, size_deg: 90, kelvin: 3400, intensity: 0.05 },
    ],
  }, { kind: "color", color: "#1a1512" }),
  look("Golden hour", {
    environment: "sunset", background_gain_ev: -0.5,
    lamps: [{ name: "Low sun", azimuth_deg: 72, elevation_deg: 12, size_deg: 8, kelvin: 2600, intensity: 0.6 }],
  }, PLACE),
  look("Neon", {
    environment: null,
    lamps: [
      { name: "Magenta", azimuth_deg: -75, elevation_deg: 8, size_deg: 40, color: [2.1, 0.06, 1.3], intensity: 0.9 },
      { name: "Cyan", azimuth_deg: 75, elevation_deg: 8, size_deg: 40, color: [0.03, 1.0, 1.6], intensity: 0.9 },
    ],
  }, { kind: "image", image: "night-street" }),
  look("Match my background", { environment: "background" }, null),
]);

/** The look whose light stands, but for how bright it is and how its place is turned; undefined where none does. */
export function standingLook({ lighting }) {
  const same = (lamp, now) => !now.muted && Object.entries(lamp).every(([field, value]) => JSON.stringify(now[field]) === JSON.stringify(value));
  return LOOKS.find(
    ({ lighting: { environment, lamps } }) =>
      environment === lighting.environment &&
      lamps.length === lighting.lamps.length &&
      lamps.every((lamp, index) => same(lamp, lighting.lamps[index])),
  );
}
