// The ball of light over the picture: a dot for each lamp and one for the place's main light, all to be dragged.

import { make, setAttribute, setEnabled } from "../widgets.js";
import { mirrored, onMirror } from "../stage/preview.js";
import { change, onScene, scene } from "../stage/scene.js";
import { lampHex } from "./colors.js";
import { clamp, directionOf, directionWords, pointOf, wrap } from "./directions.js";
import { openCard, showCard } from "./card.js";
import { MOST_LAMPS, addLamp, changeLamp, doubleLamp, lampName, removeLamp } from "./lamps.js";
import { mainLight } from "./main_light.js";

const STEP_DEG = 5;
const FINE_STEP_DEG = 1;
const INTENSITY_STEP = 0.1;
const MOST_INTENSITY = 5;
const DRAGGED_PIXELS = 4;
const SUN_ELEVATION_DEG = 62; // higher than that it would hardly move while it is turned

const ball = document.getElementById("ball");
const turn = make("div", { id: "turn", className: "sun", tabIndex: 0, role: "slider", "aria-label": "Turn the place", "aria-valuemin": "-180", "aria-valuemax": "180" }, make("span", { className: "disc" }));
const dots = [];
let sun = { azimuth_deg: 0, elevation_deg: 30, color: "#ffffff" };

ball.append(make("div", { className: "ring", "aria-hidden": "true" }), turn);

// Drawing

function put(element, azimuth, elevation) {
  const { x, y, behind } = pointOf(azimuth, elevation, mirrored());
  element.style.setProperty("--x", x.toFixed(4));
  element.style.setProperty("--y", y.toFixed(4));
  element.classList.toggle("behind", behind);
  return behind;
}

function drawLamp(dot, lamp, index) {
  put(dot, lamp.azimuth_deg, lamp.elevation_deg);
  dot.style.setProperty("--color", lampHex(lamp));
  dot.style.setProperty("--size", (Math.min(lamp.size_deg, 120) / 90).toFixed(3));
  dot.style.setProperty("--strength", clamp(0.25 + lamp.intensity * 0.3, 0.25, 0.9).toFixed(2));
  dot.classList.toggle("muted", Boolean(lamp.muted));
  const name = lampName(lamp, index);
  const words = `${name}, ${directionWords(lamp.azimuth_deg, lamp.elevation_deg, mirrored())}${lamp.muted ? ", muted" : ""}`;
  setAttribute(dot, "aria-label", name);
  setAttribute(dot, "aria-valuenow", Math.round(wrap(lamp.azimuth_deg)));
  setAttribute(dot, "aria-valuetext", words);
  setAttribute(dot, "title", words);
}

function draw(now) {
  const { lamps, environment, yaw_deg: yaw } = now.lighting;
  const held = dots.indexOf(document.activeElement) >= lamps.length;
  while (dots.length > lamps.length) dots.pop().remove();
  if (held) (dots.at(-1) ?? document.getElementById("lamp-add")).focus();
  while (dots.length < lamps.length) dots.push(addDot(dots.length));
  lamps.forEach((lamp, index) => drawLamp(dots[index], lamp, index));
  turn.hidden = environment === null;
  ball.classList.toggle("turns", environment !== null);
  if (environment !== null) {
    put(turn, sun.azimuth_deg + yaw, Math.min(sun.elevation_deg, SUN_ELEVATION_DEG));
    turn.style.setProperty("--color", sun.color);
    const degrees = Math.round(wrap(yaw));
    setAttribute(turn, "aria-valuenow", degrees);
    const side = degrees > 0 !== mirrored() ? "right" : "left";
    setAttribute(turn, "aria-valuetext", degrees === 0 ? "not turned" : `turned ${Math.abs(degrees)} degrees to the ${side}`);
    setAttribute(turn, "title", `The light of ${environment}: drag it, or beside your face, to turn the place`);
  }
  const silent = environment === null && lamps.every((lamp) => lamp.muted || lamp.intensity === 0);
  document.getElementById("no-light").hidden = !silent;
  setEnabled(document.getElementById("lamp-add"), lamps.length < MOST_LAMPS);
  showCard(now, dots);
}

let lit = null;

/** The place's main light, found anew when the place is another one. */
async function findSun(environment) {
  if (environment === lit) return;
  lit = environment;
  const found = await mainLight(environment);
  if (environment !== lit) return;
  sun = found;
  if (scene()) draw(scene());
}

onScene((now) => {
  draw(now);
  findSun(now.lighting.environment);
});
onMirror(() => scene() && draw(scene()));

// Pointer and keys

/** A point of the page on the ball, in radii of its ring. */
function onBall(event) {
  const box = ball.getBoundingClientRect();
  return [((event.clientX - box.left) / box.width) * 2 - 1, ((event.clientY - box.top) / box.height) * 2 - 1];
}

function addDot(index) {
  const dot = make("div", { className: "lamp-dot", tabIndex: 0, role: "slider", "aria-valuemin": "-180", "aria-valuemax": "180", "aria-haspopup": "dialog" }, make("span", { className: "glow" }), make("span", { className: "disc" }));
  dot.dataset.lamp = String(index);
  drag(dot, {
    move: ([x, y]) => changeLamp(index, directionOf(x, y, mirrored())),
    click: () => openCard(index),
  });
  dot.onkeydown = (event) => {
    const lamp = scene().lighting.lamps[index];
    const part = lampKey(event, lamp);
    if (part) changeLamp(index, part);
    else if (event.key === "Enter" || event.key === " ") openCard(index);
    else if (event.key === "Delete" || event.key === "Backspace") removeLamp(index);
    else if (event.key === "d" && !event.ctrlKey && !event.metaKey) doubleLamp(index);
    else return;
    event.preventDefault();
  };
  dot.addEventListener("wheel", (event) => {
    event.preventDefault();
    changeLamp(index, { intensity: brighter(scene().lighting.lamps[index], -Math.sign(event.deltaY)) });
  }, { passive: false });
  ball.append(dot);
  return dot;
}

/** A lamp's intensity, some steps brighter. */
function brighter(lamp, steps) {
  return Number(clamp(lamp.intensity + steps * INTENSITY_STEP, 0, MOST_INTENSITY).toFixed(2));
}

/** What a key changes of a lamp, or null. */
function lampKey(event, lamp) {
  if (event.ctrlKey || event.metaKey || event.altKey) return null;
  const step = event.shiftKey ? FINE_STEP_DEG : STEP_DEG;
  const side = mirrored() ? -step : step;
  switch (event.key) {
    case "ArrowLeft": return { azimuth_deg: wrap(lamp.azimuth_deg - side) };
    case "ArrowRight": return { azimuth_deg: wrap(lamp.azimuth_deg + side) };
    case "ArrowUp": return { elevation_deg: clamp(lamp.elevation_deg + step, -90, 90) };
    case "ArrowDown": return { elevation_deg: clamp(lamp.elevation_deg - step, -90, 90) };
    case "PageUp": return { intensity: brighter(lamp, 1) };
    case "PageDown": return { intensity: brighter(lamp, -1) };
    case "m": return { muted: !lamp.muted };
    default: return null;
  }
}

/** Lets an element be dragged: `move([x, y] on the ball)`, `click()` where it was not moved. */
function drag(element, { start = () => {}, move, click = () => {} }) {
  let from = null;
  let moved = false;
  element.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || event.target.closest("[data-lamp], #turn, button") !== element.closest("[data-lamp], #turn, button")) return;
    element.setPointerCapture(event.pointerId);
    from = [event.clientX, event.clientY];
    moved = false;
    start(onBall(event));
  });
  element.addEventListener("pointermove", (event) => {
    if (!from) return;
    moved ||= Math.hypot(event.clientX - from[0], event.clientY - from[1]) > DRAGGED_PIXELS;
    if (moved) move(onBall(event));
  });
  const end = (event) => {
    if (!from) return;
    from = null;
    if (!moved && event.type === "pointerup") click(event);
  };
  element.addEventListener("pointerup", end);
  element.addEventListener("pointercancel", end);
}

function setYaw(degrees) {
  change({ lighting: { yaw_deg: Math.round(wrap(degrees)) } });
}

/** Turns the place as far as the pointer goes: a radius of the ring is a quarter turn. */
function dragTurns(element) {
  let from = null;
  drag(element, {
    start: ([x]) => { from = { x, yaw: scene()?.lighting.yaw_deg ?? 0 }; },
    move: ([x]) => {
      if (!scene() || scene().lighting.environment === null) return;
      setYaw(from.yaw + (x - from.x) * 90 * (mirrored() ? -1 : 1));
    },
  });
}

dragTurns(ball);
dragTurns(turn);
turn.onkeydown = (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const step = event.shiftKey ? FINE_STEP_DEG : STEP_DEG;
  const yaw = scene().lighting.yaw_deg;
  const side = mirrored() ? -step : step;
  if (event.key === "ArrowRight" || event.key === "ArrowUp") setYaw(yaw + side);
  else if (event.key === "ArrowLeft" || event.key === "ArrowDown") setYaw(yaw - side);
  else if (event.key === "Home") setYaw(0);
  else return;
  event.preventDefault();
};
ball.ondblclick = (event) => {
  if (!event.target.closest("[data-lamp], #turn")) addLamp(directionOf(...onBall(event), mirrored()));
};

document.getElementById("lamp-add").onclick = () => {
  if (dots.length >= MOST_LAMPS) return;
  addLamp();
  openCard(dots.length - 1);
};
document.getElementById("no-light-lamp").onclick = () => addLamp();
document.getElementById("show-ball").onclick = (event) => {
  const shown = event.target.getAttribute("aria-pressed") !== "true";
  event.target.setAttribute("aria-pressed", String(shown));
  ball.hidden = !shown;
};
