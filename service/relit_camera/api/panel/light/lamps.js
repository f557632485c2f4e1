// The lamps: adding, changing, removing them, and their list beside the picture.

import { keyed, make, setAttribute, setText } from "../widgets.js";
import { change, onScene, scene } from "../stage/scene.js";
import { lampHex } from "./colors.js";
import { openCard } from "./card.js";
import { clamp } from "./directions.js";

export const MOST_LAMPS = 16;
/** What "Add lamp" adds, and "Lamps only" where there is none: a key light. */
export const KEY_LIGHT = { azimuth_deg: 45, elevation_deg: 30, size_deg: 25, kelvin: 5000, intensity: 1 };
const DOUBLE_OFFSET_DEG = 20;

const lamps = () => scene()?.lighting.lamps ?? [];

/** A lamp's own name, or its number. */
export function lampName(lamp, index) {
  return lamp.name || `Lamp ${index + 1}`;
}

function replace(all) {
  change({ lighting: { lamps: all } });
}

/** Adds a lamp; where others are, opposite them unless `direction` says where. */
export function addLamp(direction = {}) {
  if (!scene() || lamps().length >= MOST_LAMPS) return;
  const side = lamps().some((lamp) => lamp.azimuth_deg > 0) && !lamps().some((lamp) => lamp.azimuth_deg < 0) ? -1 : 1;
  replace([...lamps(), { ...KEY_LIGHT, azimuth_deg: side * KEY_LIGHT.azimuth_deg, ...direction }]);
}

export function changeLamp(index, part) {
  replace(lamps().map((lamp, other) => (other === index ? { ...lamp, ...part } : lamp)));
}

/** Removes a lamp; the focus goes to the one before it on the ball, or to the button that adds one. */
export function removeLamp(index) {
  replace(lamps().filter((_, other) => other !== index));
  const next = document.querySelector(`#ball [data-lamp="${Math.max(0, index - 1)}"]`) ?? document.getElementById("lamp-add");
  next.focus();
}

/** Puts a second lamp of the same kind beside one. */
export function doubleLamp(index) {
  if (lamps().length >= MOST_LAMPS) return;
  const lamp = lamps()[index];
  const beside = lamp.azimuth_deg + (lamp.azimuth_deg > 0 ? -DOUBLE_OFFSET_DEG : DOUBLE_OFFSET_DEG);
  replace([...lamps(), { ...lamp, name: "", azimuth_deg: clamp(beside, -360, 360) }]);
  openCard(lamps().length - 1);
}

function row(index) {
  const swatch = make("span", { className: "swatch", "aria-hidden": "true" });
  const name = make("button", { type: "button", className: "plain", "aria-haspopup": "dialog" }, swatch, make("span"));
  name.onclick = () => openCard(index, name);
  const mute = make("button", { type: "button", className: "quiet toggle" }, "Mute");
  mute.onclick = () => changeLamp(index, { muted: !lamps()[index].muted });
  return {
    element: make("li", {}, name, mute),
    update: ({ lamp }) => {
      setText(name.lastChild, lampName(lamp, index));
      swatch.style.setProperty("--color", lampHex(lamp));
      setAttribute(mute, "aria-label", `Mute ${lampName(lamp, index)}`);
      setAttribute(mute, "aria-pressed", Boolean(lamp.muted));
    },
  };
}

onScene((now) => {
  const items = now.lighting.lamps.map((lamp, index) => ({ lamp, index }));
  keyed(document.getElementById("lamps"), items, ({ index }) => index, ({ index }) => row(index));
  document.getElementById("lamps-none").hidden = items.length > 0;
});
