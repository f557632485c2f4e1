// The desk capture: asks for sizes, then shows the patterns that the camera asks for, full screen.

import { Refused, call, sentence } from "../api.js";
import { FramingHelp } from "../first/framing.js";
import { showProblem } from "../first/problem.js";
import { on, openEvents } from "../stage/events.js";
import { Steps } from "./steps.js";

const CARD_CM = 8.56; // ISO/IEC 7810 ID-1: every bank card
const CARD_HEIGHT_CM = 5.398;
const POLL_MS = 80;
const ZOOMS = [0.25, 1 / 3, 0.5, 2 / 3, 0.75, 0.8, 0.9, 1, 1.1, 1.25, 1.5, 1.75, 2, 2.5, 3, 4, 5]; // that browsers offer
const $ = (id) => document.getElementById(id);

const RESIZED = { what: "the window’s size changed while the patterns were shown", cure: "leave it as it is until they end" };
const GONE = { what: "the camera ended meanwhile", cure: "begin again" };

let wanted = false; // patterns were asked for, and nobody has stopped them
let running = false; // the camera films them

/** Centimeters that a pixel of the screen is wide, by the card. CSS pixels grow with the page's zoom, these do not. */
let pixelCm = 0;

function showSize() {
  const width = Number($("card-width").value);
  $("card").style.width = `${width}px`;
  $("card").style.height = `${(width * CARD_HEIGHT_CM) / CARD_CM}px`;
  pixelCm = CARD_CM / (width * devicePixelRatio);
  const cm = [screen.width, screen.height].map((pixels) => pixels * unzoomedRatio() * pixelCm);
  const inches = Math.hypot(...cm) / 2.54;
  $("screen-size").textContent = `The screen is ${cm[0].toFixed(1)} × ${cm[1].toFixed(1)} cm, ${inches.toFixed(0)} inches.`;
}

/** Pixels of the screen for one of `screen.width`: some browsers count that in CSS pixels, others without the zoom. */
function unzoomedRatio() {
  const zoom = outerWidth / innerWidth; // 1 in browsers whose windows are measured in CSS pixels, too
  const nearest = ZOOMS.reduce((best, each) => (Math.abs(each - zoom) < Math.abs(best - zoom) ? each : best));
  return devicePixelRatio / nearest;
}

/** What the camera is to know. The patterns fill the window, which is the whole screen now. */
function body() {
  const [width, height] = [innerWidth, innerHeight].map((pixels) => pixels * devicePixelRatio * pixelCm);
  const up = height / 2 + Number($("camera-edge").value);
  return {
    name: $("name").value,
    screen_width_cm: width,
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

async function leaveFullScreen() {
  $("patterns").hidden = true;
  if (document.fullscreenElement) await document.exitFullscreen().catch(() => null);
}

function tell(status) {
  if (status.stage === "building") return steps.show("building", true);
  const done = status.stage === "done";
  const stopped = status.stage === "canceled";
  $("result-title").textContent = done ? "That is you, measured" : stopped ? "Stopped" : "That did not work";
  $("result").textContent = stopped
    ? "Nothing was stored, and the webcam is as it was."
    : done
      ? [`Stored as “${status.subject}”, and shown.`, status.what && sentence(status.what), status.cure && sentence(status.cure)].filter(Boolean).join(" ")
      : "";
  showProblem($("desk-problem"), done || stopped ? null : status);
  $("result-view").hidden = !done;
  if (done) $("result-picture").src = `/api/v1/preview.mjpg?mirror=true&width=640&fps=15&opened=${Date.now()}`;
  $("desk-again").textContent = done ? "Once more" : "Try again";
  $("desk-next").hidden = !done;
  steps.show("result", true);
}

/** Stops the patterns, also while they only begin; `problem` is why, null where a person did it. */
async function stop(problem = null) {
  if (!wanted) return;
  wanted = false;
  const begun = running;
  running = false;
  await leaveFullScreen();
  if (begun) await cancel(problem); // else what has just been asked for ends it once it is answered
}

async function cancel(problem = null) {
  try {
    const status = await call("DELETE", "captures/desk");
    tell(problem ? { stage: "failed", ...problem } : status);
  } catch (error) {
    tell({ stage: "failed", ...(problem ?? told(error)) });
  }
}

function told(error) {
  return { what: error.what ?? error.message, cure: error.cure ?? "" };
}

async function run() {
  let status = await call("POST", "captures/desk", body());
  if (!wanted) return cancel();
  makeGrid(status);
  $("patterns").hidden = false;
  running = true;
  const size = [innerWidth, innerHeight];
  let key = "";
  while (running) {
    const now = `${status.stage} ${status.step}`;
    if (status.stage !== "exposing" && status.stage !== "filming") break;
    if (now !== key) {
      key = now;
      paint(status);
      await drawn();
    }
    const shown = document.hidden ? -1 : status.step;
    await new Promise((resolve) => setTimeout(resolve, POLL_MS));
    // What is lit is no longer what was measured. Where full screen has ended, its event stops the patterns.
    if (document.fullscreenElement && (innerWidth !== size[0] || innerHeight !== size[1])) await stop(RESIZED);
    if (running) status = await call("PUT", "captures/desk/shown", { step: shown });
  }
  if (!running) return;
  wanted = running = false;
  await leaveFullScreen();
  await follow(status);
}

/** Shows how far the computing is, until it ends; a missed answer does not end it. */
async function follow(first) {
  let status = first;
  tell(status);
  while (status.stage === "building") {
    await new Promise((resolve) => setTimeout(resolve, 500));
    try {
      status = await call("GET", "captures/desk");
    } catch (error) {
      if (error.status) throw error;
    }
  }
  tell(status.stage === "idle" ? { stage: "failed", ...GONE } : status);
}

async function begin() {
  $("start").disabled = true;
  framing.close();
  wanted = true;
  try {
    await document.documentElement.requestFullscreen?.().catch(() => null);
    if (wanted && !document.fullscreenElement) {
      throw new Refused("the browser did not give the whole screen", "allow this page full screen, or try another browser");
    }
    if (wanted) await run();
    else tell({ stage: "canceled" });
  } catch (error) {
    if (running) await stop(told(error));
    else tell({ stage: "failed", ...told(error) });
  }
  wanted = false;
  await leaveFullScreen(); // also where it came only after the stop
  $("start").disabled = false;
}

const framing = new FramingHelp(on);
$("framing-help").append(framing.view, framing.advice, framing.marks);

const steps = new Steps(["warning", "size", "place", "framing", "building", "result"], ["warning", "size", "place", "framing"], (name) => {
  if (name !== "result") $("result-picture").removeAttribute("src");
  if (name === "size") showSize();
  $("start").disabled = !$("understood").checked;
  if (name === "framing") framing.start();
  else framing.close();
});

$("understood").onchange = () => {
  $("accept").disabled = !$("understood").checked;
};
$("accept").onclick = () => steps.next();
$("size-next").onclick = () => steps.next();
$("place-next").onclick = () => {
  const wrong = ["distance", "camera-edge", "name"].find((id) => !$(id).reportValidity());
  if (!wrong) steps.next();
};
$("start").onclick = begin;
$("desk-again").onclick = () => steps.show("framing", true);
$("desk-cancel").onclick = () => cancel();
$("card-width").oninput = showSize;
addEventListener("resize", () => { if (steps.current === "size") showSize(); }); // zoomed while the card is held there
document.addEventListener("fullscreenchange", () => { if (!document.fullscreenElement) stop(); });
document.addEventListener("keydown", (event) => { if (event.key === "Escape") stop(); });
document.addEventListener("visibilitychange", () => { if (document.hidden) stop(); });
addEventListener("pagehide", () => { if (wanted) fetch("/api/v1/captures/desk", { method: "DELETE", keepalive: true }); });
showSize();
steps.show("warning");
openEvents();
const status = await call("GET", "captures/desk").catch(() => null);
if (status?.stage === "building") follow(status).catch((error) => tell({ stage: "failed", ...told(error) }));
