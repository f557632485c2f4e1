// A lamp's card, beside its dot: name, intensity, warmth or colour, size; mute, double, delete.

import { choose, make, percent, setText, slider } from "../widgets.js";
import { scene } from "../stage/scene.js";
import { changeLamp, doubleLamp, lampName, removeLamp } from "./lamps.js";
import { lampHex, linearOfHex } from "./colors.js";
import { clamp } from "./directions.js";

const GAP = 14;
const MARGIN = 8;
const DEFAULT_KELVIN = 5000;

const name = make("input", { type: "text", maxLength: 40, autocomplete: "off", spellcheck: false, "aria-label": "Name" });
const close = make("button", { type: "button", className: "close", "aria-label": "Close" }, "×");
const intensity = slider({ label: "Intensity", min: 0, max: 5, step: 0.05, initial: 1, show: percent }, (value) => put({ intensity: value }));
const kinds = make("div", { className: "choice", role: "group", "aria-label": "Colour of the light" },
  make("button", { type: "button", value: "warmth" }, "Warmth"), make("button", { type: "button", value: "color" }, "Colour"));
const warmth = slider(
  { label: "Warmth", min: 1800, max: 12000, step: 100, initial: DEFAULT_KELVIN, className: "warmth", show: (value) => `${Math.round(value)} K` },
  (value) => put({ kelvin: value, color: null }),
);
const color = make("input", { type: "color", id: "lamp-color" });
const colorRow = make("div", { className: "row" }, make("label", { htmlFor: color.id }, "Colour"), color);
const size = slider({ label: "Size", min: 1, max: 120, step: 1, initial: 25, show: (value) => `${Math.round(value)}°` }, (value) => put({ size_deg: value }));
const mute = make("button", { type: "button", className: "quiet toggle" }, "Mute");
const double = make("button", { type: "button", className: "quiet" }, "Double");
const remove = make("button", { type: "button", className: "quiet" }, "Delete");
const card = make("div", { id: "lamp-card", className: "card", role: "dialog", hidden: true },
  make("div", { className: "section" }, name, close),
  intensity.element, kinds, warmth.element, colorRow, size.element,
  make("p", { className: "actions" }, mute, double, remove));
document.body.append(card);

let open = -1;
let opener = null;

function put(part) {
  if (open >= 0) changeLamp(open, part);
}

/** Opens the card of a lamp; when it closes, the focus goes back to `from`, or the lamp's dot. */
export function openCard(index, from = null) {
  if (!scene()?.lighting.lamps[index]) return;
  if (document.activeElement === name) putName();
  open = index;
  opener = from;
  card.hidden = false;
  showCard(scene(), [...document.querySelectorAll("#ball [data-lamp]")]);
  intensity.element.querySelector("input").focus({ preventScroll: true }); // not the name: a phone would show its keys
}

function closeCard() {
  if (open < 0) return;
  if (document.activeElement === name) putName(); // its `change` would come too late
  const there = scene().lighting.lamps[open] !== undefined;
  const dot = document.querySelector(`#ball [data-lamp="${open}"]`);
  const add = card.contains(document.activeElement) ? document.getElementById("lamp-add") : null;
  const back = there ? (opener ?? dot) : add;
  open = -1;
  card.hidden = true;
  back?.focus();
}

/** Shows the lamp as it now is, beside its dot. */
export function showCard(now, dots) {
  if (open < 0) return;
  const lamp = now.lighting.lamps[open];
  if (!lamp) {
    closeCard();
    return;
  }
  card.setAttribute("aria-label", lampName(lamp, open));
  if (document.activeElement !== name) name.value = lamp.name ?? "";
  name.placeholder = `Lamp ${open + 1}`;
  intensity.set(lamp.intensity);
  choose(kinds, lamp.color ? "color" : "warmth");
  warmth.element.hidden = Boolean(lamp.color);
  colorRow.hidden = !lamp.color;
  if (lamp.kelvin) warmth.set(lamp.kelvin);
  if (document.activeElement !== color) color.value = lampHex(lamp);
  size.set(lamp.size_deg);
  mute.setAttribute("aria-pressed", String(Boolean(lamp.muted)));
  setText(mute, "Mute");
  place(dots[open]);
}

/** Beside the dot, on its side that is away from the face; below or above it where there is no room. */
function place(dot) {
  if (!dot || card.matches(":active")) return; // not out of the hand that moves its slider
  const at = dot.getBoundingClientRect();
  const picture = document.getElementById("screen").getBoundingClientRect();
  const { width, height } = card.getBoundingClientRect();
  const [most, lowest] = [document.documentElement.clientWidth - width - MARGIN, window.innerHeight - height - MARGIN];
  const outward = at.left + at.width / 2 < picture.left + picture.width / 2 ? at.left - GAP - width : at.right + GAP;
  const fits = outward >= MARGIN && outward <= most;
  const upper = at.top + at.height / 2 < picture.top + picture.height / 2;
  const beyond = upper ? at.bottom + GAP : at.top - GAP - height;
  const top = fits ? at.top + at.height / 2 - height / 2 : beyond;
  card.style.setProperty("--left", `${clamp(outward, MARGIN, most)}px`);
  card.style.setProperty("--top", `${clamp(top, MARGIN, lowest)}px`);
}

function putName() {
  const lamp = scene().lighting.lamps[open];
  const typed = name.value.trim();
  if (lamp && typed !== (lamp.name ?? "")) put({ name: typed });
}

name.onchange = putName;
name.onkeydown = (event) => {
  if (event.key === "Enter") closeCard();
};
kinds.onclick = (event) => {
  const kind = event.target.closest("button")?.value;
  const lamp = scene().lighting.lamps[open];
  if (kind === "warmth" && lamp.color) put({ color: null, kelvin: DEFAULT_KELVIN });
  if (kind === "color" && !lamp.color) put({ color: linearOfHex(lampHex(lamp)), kelvin: null });
};
color.oninput = () => put({ color: linearOfHex(color.value), kelvin: null });
mute.onclick = () => put({ muted: !scene().lighting.lamps[open].muted });
double.onclick = () => doubleLamp(open);
remove.onclick = () => {
  const index = open;
  closeCard();
  removeLamp(index);
};
close.onclick = closeCard;
card.addEventListener("keydown", (event) => {
  if (event.key === "Escape") closeCard();
});
document.addEventListener("pointerdown", (event) => {
  if (open >= 0 && !event.target.closest("#lamp-card, #ball [data-lamp], #lamps, #lamp-add")) closeCard();
});
