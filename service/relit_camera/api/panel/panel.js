// The panel: keeps the page in step with the camera, and the camera with the page.

import { Latest, attempt, request, sentence } from "./api.js";
import { BackgroundControls } from "./background.js";
import { InstantCapture } from "./instant.js";
import { Lamps, wrap } from "./lamps.js";
import { Library } from "./library.js";
import { choose, degrees, make, percent, slider, stops } from "./widgets.js";

const PREVIEW_FPS = 24;
const RETRY_MS = 1000;
const MODE_HINTS = {
  reenact: "Your captured picture, relit, moves as you move. The webcam’s picture stays private.",
  ratio: "The live picture itself, relit. Your own mouth and eyes.",
};
const STATES = {
  starting: "Starting…",
  live: "Live",
  searching: "Looking for your face",
  "standing-in": "Showing the captured picture at rest: see below",
  waiting: "Waiting for the camera",
  released: "Webcam released until somebody looks",
  capturing: "Measuring your face: look at the camera",
  frozen: "Frozen",
  stopping: "Stopping…",
  lost: "Not connected",
};
const RUNG_HINTS = {
  instant: "Captured in the light of a room: soft places look right, lamps from behind are softened. Truer: a desk capture.",
  desk: "Captured before a monitor: light from the front is measured, from behind it is modelled. Truer: a film.",
};
const LIGHT = {
  yaw_deg: { label: "Rotation", min: -180, max: 180, step: 1, initial: 0, show: degrees, of: wrap },
  exposure_ev: { label: "Exposure", min: -4, max: 4, step: 0.1, initial: 0, show: stops },
  saturation: { label: "Saturation", min: 0, max: 2, step: 0.05, initial: 1, show: percent },
  blend: { label: "Blend", min: 0, max: 1, step: 0.01, initial: 1, show: percent },
  split: { label: "As filmed", min: 0, max: 1, step: 0.01, initial: 0, show: percent },
};
const MORE_LIGHT = {
  pitch_deg: { label: "Tilt", min: -90, max: 90, step: 1, initial: 0, show: degrees },
  roll_deg: { label: "Roll", min: -180, max: 180, step: 1, initial: 0, show: degrees, of: wrap },
  face_gain_ev: { label: "Face", min: -4, max: 4, step: 0.1, initial: 0, show: stops },
  background_gain_ev: { label: "Background", min: -4, max: 4, step: 0.1, initial: 0, show: stops },
  transition_s: { label: "Transition", min: 0, max: 5, step: 0.1, initial: 0.4, show: (value) => `${value.toFixed(1)} s` },
};

let scene = null;
const byId = (id) => document.getElementById(id);
const lighting = new Latest(sendLighting, { settled: restore });
const sliders = {};

for (const [place, specs] of [["light", LIGHT], ["light-more", MORE_LIGHT]]) {
  for (const [field, spec] of Object.entries(specs)) {
    sliders[field] = { ...slider(spec, (value) => lighting.push({ [field]: value })), of: spec.of ?? ((value) => value) };
    byId(place).append(sliders[field].element);
  }
}

const background = new BackgroundControls();
const library = new Library(() => scene, (change) => lighting.push(change), (body) => background.send(body));
background.use(library);
const instant = new InstantCapture();
const lamps = new Lamps((all) => lighting.push({ lamps: all }), mirrored);

// Page → camera

byId("mode").onclick = (event) => {
  const mode = event.target.closest("button")?.value;
  if (mode) attempt("PUT", "mode", { mode });
};
byId("freeze").onclick = () => attempt("PUT", "freeze", { frozen: !scene?.frozen });
byId("neutral").onclick = () => attempt("POST", "neutral-pose");
byId("mirror").onclick = () => {
  byId("mirror").setAttribute("aria-pressed", String(!mirrored()));
  lamps.redraw();
  openPreview();
};

function mirrored() {
  return byId("mirror").getAttribute("aria-pressed") === "true";
}

// Camera → page

function showScene(now) {
  scene = now;
  for (const [field, control] of Object.entries(sliders)) control.set(control.of(now.lighting[field]));
  sliders.split.element.hidden = now.mode !== "ratio";
  if (lighting.idle) lamps.show(now.lighting.lamps);
  choose(byId("mode"), now.mode);
  byId("mode-hint").textContent = MODE_HINTS[now.mode];
  byId("rung-hint").textContent = RUNG_HINTS[now.rung] ?? "";
  byId("freeze").setAttribute("aria-pressed", String(now.frozen));
  background.show(now.background);
  library.draw();
}

async function sendLighting(change) {
  const stands = await request("PATCH", "lighting", change);
  if (scene) scene = { ...scene, lighting: stands };
}

/** Show again what stands: after a change was refused, or when all are sent. */
function restore() {
  if (scene) showScene(scene);
}

function showState(state, tracking) {
  byId("state").dataset.state = state;
  byId("state-text").textContent = STATES[state] ?? sentence(state);
  const veiled = ["waiting", "lost", "starting", "capturing"].includes(state);
  byId("veil").hidden = !veiled || (state === "waiting" && byId("preview").naturalWidth > 0);
  byId("veil").textContent = STATES[state] ?? "";
  document.body.classList.toggle("lost", state === "lost");
  if (tracking) byId("figure-tracker").textContent = `Face ${tracking.state} (${tracking.name})`;
}

function showStatus(status) {
  showState(status.state, status.tracker);
  const rate = (value) => (value ?? 0).toFixed(1);
  byId("figure-fps").textContent = `${rate(status.fps.published)} fps (camera ${rate(status.fps.camera)})`;
  const { p50, p95 } = status.latency_ms;
  byId("figure-latency").textContent = `Latency ${Math.round(p50)} ms, 95 % below ${Math.round(p95)} ms`;
  byId("figure-way").textContent = `${status.source} → ${status.sink}`;
  const notes = status.degraded.map(({ what, why, cure }) =>
    make("li", {}, make("strong", {}, sentence(what)), ` ${sentence(why)}`, ...(cure ? [make("em", {}, sentence(cure))] : [])),
  );
  byId("notes").replaceChildren(...notes);
  byId("notes").hidden = notes.length === 0;
}

function showCaption({ text }) {
  if (byId("caption").textContent === text) return; // it is told again and again
  byId("caption").textContent = text;
  byId("caption").hidden = !text;
}

function openEvents() {
  const events = new EventSource("/api/v1/events");
  const on = (kind, show) => events.addEventListener(kind, (event) => show(JSON.parse(event.data)));
  on("scene", showScene);
  on("status", showStatus);
  on("caption", showCaption);
  on("capture", (status) => instant.show(status));
  on("collection", ({ name }) => library.load(name).then(restore));
  events.onopen = () => {
    showCaption({ text: "" });
    library.loadAll().then(restore);
    instant.load();
    openPreview();
  };
  events.onerror = () => {
    showState("lost");
    if (events.readyState !== EventSource.CLOSED) return;
    attempt("GET", "mode"); // which finds out whether the token is needed again
    setTimeout(openEvents, RETRY_MS);
  };
}

// Preview: only while somebody looks, and no larger than it is shown

let retry = 0;

function openPreview() {
  const image = byId("preview");
  clearTimeout(retry);
  if (document.hidden) {
    image.removeAttribute("src");
    return;
  }
  const pixels = image.clientWidth * Math.min(window.devicePixelRatio, 2);
  const width = Math.max(320, Math.ceil(pixels / 160) * 160);
  image.src = `/api/v1/preview.mjpg?mirror=${mirrored()}&width=${width}&fps=${PREVIEW_FPS}&opened=${Date.now()}`;
}

byId("preview").onerror = () => {
  // While nothing answers at all, the events find out when it does again.
  if (!document.body.classList.contains("lost")) retry = setTimeout(openPreview, RETRY_MS);
};
document.addEventListener("visibilitychange", openPreview);
addEventListener("pagehide", () => byId("preview").removeAttribute("src"));

openEvents();
