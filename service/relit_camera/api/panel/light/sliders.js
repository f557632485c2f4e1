// The sliders of the light as a whole.

import { degrees, percent, slider, stops } from "../widgets.js";
import { change, onScene } from "../stage/scene.js";
import { wrap } from "./directions.js";

const LIGHT = {
  exposure_ev: { label: "Exposure", min: -2, max: 2, step: 0.1, initial: 0, show: (value) => (value === 0 ? "auto" : stops(value)) },
  yaw_deg: { label: "Turn", min: -180, max: 180, step: 1, initial: 0, show: degrees, of: wrap },
  saturation: { label: "Saturation", min: 0, max: 2, step: 0.05, initial: 1, show: percent },
};
const MORE = {
  pitch_deg: { label: "Tilt", min: -90, max: 90, step: 1, initial: 0, show: degrees },
  roll_deg: { label: "Roll", min: -180, max: 180, step: 1, initial: 0, show: degrees, of: wrap },
  face_gain_ev: { label: "Face", min: -2, max: 2, step: 0.1, initial: 0, show: stops },
  background_gain_ev: { label: "Background", min: -4, max: 4, step: 0.1, initial: 0, show: stops },
  blend: { label: "Amount", min: 0.05, max: 1, step: 0.05, initial: 1, show: percent },
  transition_s: { label: "Transition", min: 0, max: 5, step: 0.1, initial: 0.4, show: (value) => `${value.toFixed(1)} s` },
};

for (const [place, specs] of [["light", LIGHT], ["light-more", MORE]]) {
  for (const [field, spec] of Object.entries(specs)) {
    const control = slider(spec, (value) => change({ lighting: { [field]: value } }));
    const shown = spec.of ?? ((value) => value);
    document.getElementById(place).append(control.element);
    onScene((now) => control.set(shown(now.lighting[field])));
  }
}
