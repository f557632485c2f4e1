// Which webcam, in what size and rate, and which tracker: chosen while the camera runs.

import { Latest, attempt, request, sentence } from "../api.js";
import { on } from "../stage/events.js";
import { setOptions, setText } from "../widgets.js";

const SIZES = [[1920, 1080], [1280, 720], [960, 540], [640, 360]];
const RATES = [15, 24, 30, 60];

const byId = (id) => document.getElementById(id);

const sizeText = ([width, height]) => `${width} × ${height}`;

let loading = null;

/** Shows what there is now; whoever asks while that is on its way gets the same. */
function look() {
  loading ??= load().finally(() => { loading = null; });
}

async function load() {
  const [devices, now, tracker] = await Promise.all([attempt("GET", "devices"), attempt("GET", "source"), attempt("GET", "tracker")]);
  if (devices && now) showSource(devices, now);
  if (tracker) setOptions(byId("tracker"), tracker.names.map((name) => [name, name]), tracker.name);
}

function showSource({ webcams }, now) {
  const found = webcams.map((webcam) => [webcam.device, webcam.name + (webcam.in_use_by.length ? ` (in use by ${webcam.in_use_by.join(", ")})` : "")]);
  if (!webcams.some((webcam) => webcam.device === now.device)) found.push([now.device, fileName(now.device)]);
  setOptions(byId("webcam"), found, now.device);
  const current = webcams.find((webcam) => webcam.device === now.device);
  const known = current?.sizes.length ? current.sizes.map(({ width, height }) => [width, height]) : SIZES;
  const sizes = withOwn(known, [now.width, now.height]);
  setOptions(byId("size"), sizes.map((size) => [size.join("x"), sizeText(size)]), `${now.width}x${now.height}`);
  const told = current?.sizes.find(({ width, height }) => width === now.width && height === now.height)?.rates ?? [];
  const rates = [...new Set([...(told.length ? told : RATES), now.fps])].sort((a, b) => a - b);
  setOptions(byId("rate"), rates.map((fps) => [String(fps), `${Number(fps.toFixed(2))} a second`]), String(now.fps));
  setText(byId("source-hint"), now.what ? `${sentence(now.what)} ${now.cure ? sentence(now.cure) : ""}` : "");
}

function fileName(device) {
  return device.split(/[\\/]/).pop();
}

function withOwn(sizes, own) {
  return sizes.some((size) => size.join() === own.join()) ? sizes : [own, ...sizes];
}

/** Asks for another source; whether it was taken or not, what then stands is shown. */
const changes = new Latest((change) => request("PATCH", "source", change), {
  settled: async () => {
    await loading; // which may have been asked before the change
    look();
  },
});

function changeSource(change) {
  setText(byId("source-hint"), "Opening…");
  changes.push(change);
}

byId("webcam").onchange = () => changeSource({ device: byId("webcam").value });
byId("size").onchange = () => {
  const [width, height] = byId("size").value.split("x").map(Number);
  changeSource({ width, height });
};
byId("rate").onchange = () => changeSource({ fps: Number(byId("rate").value) });
byId("tracker").onchange = async () => {
  await attempt("PUT", "tracker", { name: byId("tracker").value });
  await loading;
  look();
};

// A webcam may have been plugged in, or changed from elsewhere: looked at anew whenever the section comes into view, and
// whenever somebody comes to it by pointer or keyboard.
const part = byId("camera-part");
new IntersectionObserver(([seen]) => seen.isIntersecting && look()).observe(part);
part.addEventListener("pointerenter", look);
part.addEventListener("focusin", ({ relatedTarget }) => !part.contains(relatedTarget) && look());
on("open", look);
look();
