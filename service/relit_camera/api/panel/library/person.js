// Who is shown and how, and the choice to be seen as filmed.

import { attempt } from "../api.js";
import { askUnlit } from "../first/doors.js";
import { on } from "../stage/events.js";
import { change, onScene, scene } from "../stage/scene.js";
import { choose, setAttribute, setOptions, setText } from "../widgets.js";
import { onStored, stored } from "./stored.js";

const MODE_HINTS = {
  reenact: "Your captured picture, relit, moves as you move: the webcam’s picture stays private.",
  ratio: "The live picture itself, relit. Your own mouth and eyes.",
};
const UNLIT_HINT = "The webcam’s picture is shown to others as it is.";
const HIDDEN_HINT = "Nobody is shown: others see a still placeholder.";

const subject = document.getElementById("subject");
const allow = document.getElementById("unlit-allow");
let unlit = false;

function draw() {
  const now = scene();
  if (!now) return;
  const current = now.subject ?? "";
  const names = stored("subjects").map((item) => item.name);
  if (current && !names.includes(current)) names.push(current);
  setOptions(subject, [["", "Nobody"], ...names.map((name) => [name, name])], current);
  choose(document.getElementById("mode"), now.mode);
  const hint = now.subject ? MODE_HINTS[now.mode] : HIDDEN_HINT;
  setText(document.getElementById("mode-hint"), unlit ? UNLIT_HINT : hint);
  setText(allow, now.unlit_allowed ? "Do not show me unlit" : "Show me unlit…");
  setAttribute(allow, "aria-pressed", now.unlit_allowed);
}

allow.onclick = () => (scene()?.unlit_allowed ? change({ unlit_allowed: false }) : askUnlit());
// Whoever is relit again is not to be shown as filmed later, when the face is lost.
subject.onchange = () => change(subject.value ? { subject: subject.value, unlit_allowed: false } : { subject: null });
document.getElementById("mode").onclick = (event) => {
  const mode = event.target.closest("button")?.value;
  if (mode) change({ mode });
};
document.getElementById("neutral").onclick = () => attempt("POST", "neutral-pose");
on("status", (status) => {
  if (unlit === Boolean(status.unlit)) return;
  unlit = Boolean(status.unlit);
  draw();
});
onScene(draw);
onStored(draw);
