// The desk capture: asks for sizes, then shows the patterns that the camera asks for, full screen.

import { request, sentence } from "./api.js";

const CARD_CM = 8.56; // ISO/IEC 7810 ID-1: every bank card
const CARD_HEIGHT_CM = 5.398;
const POLL_MS = 80;
const $ = (id) => document.getElementById(id);

let running = false;
let shown = -1;

/** Centimeters a CSS pixel is wide, by the card. */
function pixelCm() {
  return CARD_CM / Number($("card-width").value);
}

function showSize() {
  const width = Number($("card-width").value);
  $("card").style.width = `${width}px`;
  $("card").style.height = `${(width * CARD_HEIGHT_CM) / CARD_CM}px`;
  const cm = [screen.width, screen.height].map((pixels) => pixels * pixelCm());
  const inches = Math.hypot(...cm) / 2.54;
  $("screen-size").textContent = `The screen is ${cm[0].toFixed(1)} × ${cm[1].toFixed(1)} cm, ${inches.toFixed(0)} inches.`;
}

function body() {
  const height = screen.height * pixelCm();
  const up = height / 2 + Number($("camera-edge").value);
  return {
    name: $("name").value,
    screen_width_cm: screen.width * pixelCm(),
    screen_height_cm: height,
    distance_cm: Number($("distance").value),
    camera_up_cm: $("camera").value === "top" ? up : -up,
    one_by_one: $("slow").checked,
  };
}

/** Makes the grid once; its cells are then only recolored. */
function makeGrid({ columns, rows }) {
  const grid = $("grid");
  grid.style.gridTemplateColumns = `repeat(${columns}, 1fr)`;
  grid.style.gridTemplateRows = `repeat(${rows}, 1fr)`;
  grid.replaceChildren(...Array.from({ length: columns * rows }, () => document.createElement("div")));
}

function paint(status) {
  const cells = $("grid").children;
  status.patches.forEach((value, index) => {
    const code = Math.round(255 * value);
    cells[index].style.backgroundColor = `rgb(${code} ${code} ${code})`;
  });
  $("progress").textContent = status.stage === "filming" ? `${status.step + 1} of ${status.steps} · Escape stops` : "Escape stops";
}

/** Answers after the next frame was drawn. */
function drawn() {
  return new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
}

function tell(status) {
  const result = $("result");
  if (status.stage === "done") result.textContent = sentence(status.what || `this is you, stored as “${status.subject}”`);
  else if (status.stage === "failed") result.textContent = `${sentence(status.what)} ${sentence(status.cure)}`;
  else if (status.stage === "canceled") result.textContent = "Stopped. Nothing was stored, and the webcam is as it was.";
  else if (status.stage === "building") result.textContent = "Making your subject: half a minute…";
  else result.textContent = "";
}

async function leaveFullScreen() {
  $("patterns").hidden = true;
  if (document.fullscreenElement) await document.exitFullscreen().catch(() => null);
}

async function stop() {
  if (!running) return;
  running = false;
  await leaveFullScreen();
  tell(await request("DELETE", "captures/desk"));
}

async function run() {
  await document.documentElement.requestFullscreen();
  let status = await request("POST", "captures/desk", body());
  makeGrid(status);
  $("patterns").hidden = false;
  running = true;
  shown = -1;
  let key = "";
  while (running) {
    const now = `${status.stage} ${status.step}`;
    if (status.stage !== "exposing" && status.stage !== "filming") break;
    if (now !== key) {
      key = now;
      paint(status);
      await drawn();
    }
    shown = document.hidden ? -1 : status.step;
    await new Promise((resolve) => setTimeout(resolve, POLL_MS));
    if (running) status = await request("PUT", "captures/desk/shown", { step: shown });
  }
  if (!running) return;
  running = false;
  await leaveFullScreen();
  tell(status);
  while (status.stage === "building") {
    await new Promise((resolve) => setTimeout(resolve, 500));
    status = await request("GET", "captures/desk");
  }
  tell(status);
}

$("understood").onchange = () => { $("start").disabled = !$("understood").checked; };
$("card-width").oninput = showSize;
$("start").onclick = () => {
  $("start").disabled = true;
  run()
    .catch(async () => { await stop(); await leaveFullScreen(); })
    .finally(() => { $("start").disabled = !$("understood").checked; });
};
document.addEventListener("fullscreenchange", () => { if (!document.fullscreenElement) stop(); });
document.addEventListener("keydown", (event) => { if (event.key === "Escape") stop(); });
document.addEventListener("visibilitychange", () => { if (document.hidden) stop(); });
addEventListener("pagehide", () => { if (running) fetch("/api/v1/captures/desk", { method: "DELETE", keepalive: true }); });
showSize();
