// Lamps: a card each, with a pad on which the lamp is dragged round the head.

import { degrees, make, percent, slider } from "./widgets.js";

const NEW_LAMP = { azimuth_deg: 45, elevation_deg: 30, size_deg: 20, kelvin: 4500, intensity: 1 };
const MOST = 16;
const STEP_DEG = 5;

/** Keeps the cards in step with the lamps. `send(lamps)` replaces all lamps; `mirrored()` says how the preview is. */
export class Lamps {
  constructor(send, mirrored) {
    this.send = send;
    this.mirrored = mirrored;
    this.lamps = [];
    this.cards = [];
    this.list = document.getElementById("lamps");
    this.add = document.getElementById("lamp-add");
    this.add.onclick = () => this.#replace([...this.lamps, { ...NEW_LAMP }]);
  }

  show(lamps) {
    this.lamps = lamps.map((lamp) => ({ ...lamp }));
    while (this.cards.length > lamps.length) this.cards.pop().element.remove();
    while (this.cards.length < lamps.length) this.#addCard(this.cards.length);
    this.cards.forEach((card, index) => card.show(this.lamps[index]));
    document.getElementById("lamps-none").hidden = lamps.length > 0;
    this.add.disabled = lamps.length >= MOST;
  }

  /** Draw the pads again: the preview was mirrored or not. */
  redraw() {
    this.cards.forEach((card, index) => card.show(this.lamps[index]));
  }

  #addCard(index) {
    const change = (part) => {
      Object.assign(this.lamps[index], part);
      this.cards[index].show(this.lamps[index]);
      this.send(this.lamps);
    };
    const remove = () => this.#replace(this.lamps.filter((_, other) => other !== index));
    const card = lampCard(index, change, remove, this.mirrored);
    this.cards.push(card);
    this.list.append(card.element);
  }

  #replace(lamps) {
    this.show(lamps);
    this.send(lamps);
  }
}

function lampCard(index, change, remove, mirrored) {
  const pad = lampPad(index, change, mirrored);
  const close = make("button", { type: "button", className: "close", "aria-label": `Remove lamp ${index + 1}` }, "×");
  close.onclick = remove;
  const place = make("span", { className: "place" });
  const intensity = slider(
    { label: "Intensity", min: 0, max: 5, step: 0.05, initial: 1, show: (value) => percent(value) },
    (value) => change({ intensity: value }),
  );
  const warmth = slider(
    { label: "Colour", min: 1800, max: 12000, step: 100, initial: 4500, className: "warmth", show: (value) => `${Math.round(value)} K` },
    (value) => change({ kelvin: value, color: null }),
  );
  const size = slider(
    { label: "Size", min: 1, max: 120, step: 1, initial: 20, show: (value) => `${Math.round(value)}°` },
    (value) => change({ size_deg: value }),
  );
  const element = make(
    "li",
    { className: "lamp" },
    make("header", { className: "section" }, make("h3", {}, `Lamp ${index + 1}`), place, close),
    pad.element,
    intensity.element,
    warmth.element,
    size.element,
  );
  return {
    element,
    show(lamp) {
      pad.show(lamp);
      intensity.set(lamp.intensity);
      warmth.set(lamp.kelvin ?? 6500);
      size.set(lamp.size_deg);
      place.textContent = placeOf(lamp);
    },
  };
}

/** The lamp seen on the sphere round the head: the middle is the camera, the edges are behind. */
function lampPad(index, change, mirrored) {
  const dot = make("span", { className: "lamp-dot" });
  const element = make(
    "div",
    { className: "pad", tabIndex: 0, role: "slider", "aria-label": `Place of lamp ${index + 1}; arrow keys move it` },
    make("span", { className: "head", "aria-hidden": "true" }),
    dot,
  );
  let lamp = NEW_LAMP;

  const moveTo = (event) => {
    const box = element.getBoundingClientRect();
    const x = clamp((event.clientX - box.left) / box.width, 0, 1) * 2 - 1;
    const y = clamp((event.clientY - box.top) / box.height, 0, 1);
    const azimuth = (mirrored() ? -x : x) * 180;
    change({ azimuth_deg: Math.round(azimuth), elevation_deg: Math.round(90 - 180 * y) });
  };
  element.onpointerdown = (event) => {
    element.setPointerCapture(event.pointerId);
    moveTo(event);
  };
  element.onpointermove = (event) => {
    if (element.hasPointerCapture(event.pointerId)) moveTo(event);
  };
  element.onkeydown = (event) => {
    const side = mirrored() ? -STEP_DEG : STEP_DEG;
    const moves = { ArrowLeft: [-side, 0], ArrowRight: [side, 0], ArrowUp: [0, STEP_DEG], ArrowDown: [0, -STEP_DEG] };
    if (!(event.key in moves)) return;
    event.preventDefault();
    const [azimuth, elevation] = moves[event.key];
    change({ azimuth_deg: wrap(lamp.azimuth_deg + azimuth), elevation_deg: clamp(lamp.elevation_deg + elevation, -90, 90) });
  };
  return {
    element,
    show(shown) {
      lamp = shown;
      const azimuth = wrap(lamp.azimuth_deg);
      element.setAttribute("aria-valuenow", String(Math.round(azimuth)));
      element.setAttribute("aria-valuemin", "-180");
      element.setAttribute("aria-valuemax", "180");
      element.setAttribute("aria-valuetext", placeOf(lamp));
      dot.style.left = `${50 + ((mirrored() ? -azimuth : azimuth) / 360) * 100}%`;
      dot.style.top = `${50 - (lamp.elevation_deg / 180) * 100}%`;
    },
  };
}

function placeOf(lamp) {
  return `azimuth ${degrees(wrap(lamp.azimuth_deg))}, elevation ${degrees(lamp.elevation_deg)}`;
}

/** An angle in −180…180. */
export function wrap(angle) {
  return ((((angle + 180) % 360) + 360) % 360) - 180;
}

function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}
