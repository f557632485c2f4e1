// The panel: the picture's state first, then the controls; and the buttons and keys that belong to none of them.

import { toast } from "./api.js";
import "./camera/status.js";
import { keepFocus } from "./focus.js";
import { on, openEvents } from "./stage/events.js";
import { firstPicture, openPreview, showBefore } from "./stage/preview.js";
import { change, onScene, scene, showsNobody, step } from "./stage/scene.js";
import { hideUnlit } from "./stage/unlit.js";
import { setAttribute, setEnabled } from "./widgets.js";

const RETRY_MS = 3000;
const byId = (id) => document.getElementById(id);

// Before all else, and without the controls: nobody is to be shown for longer than they want
byId("unlit-stop").onclick = hideUnlit;
byId("hide").onclick = () => change({ subject: null, unlit_allowed: false, frozen: false });
onScene((now) => { byId("hide").hidden = showsNobody(now); });
keepFocus();

// Undo, redo, reset

byId("undo").onclick = () => scene()?.can_undo && step("undo");
byId("redo").onclick = () => scene()?.can_redo && step("redo");
byId("reset").onclick = async () => {
  if (await step("reset")) toast("Everything is as at the first start", "Undo takes it back");
};
byId("freeze").onclick = () => scene() && change({ frozen: !scene().frozen });
onScene((now) => {
  setEnabled(byId("undo"), now.can_undo);
  setEnabled(byId("redo"), now.can_redo);
  setAttribute(byId("freeze"), "aria-pressed", now.frozen);
});

// Before and after: as long as it is held, and in this preview only

const before = byId("before");

function hold(held) {
  if (held === (before.getAttribute("aria-pressed") === "true")) return;
  before.setAttribute("aria-pressed", String(held));
  showBefore(held);
}

before.addEventListener("pointerdown", (event) => {
  before.setPointerCapture(event.pointerId);
  hold(true);
});
for (const end of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) before.addEventListener(end, () => hold(false));
before.addEventListener("contextmenu", (event) => event.preventDefault()); // a long press
const holds = (event) => event.key.toLowerCase() === "b" || (event.target === before && [" ", "Enter"].includes(event.key));

function isText(element) {
  return element.matches?.("input[type=text], input[type=password], textarea, select");
}

document.addEventListener("keydown", (event) => {
  if (isText(event.target) || document.querySelector("dialog[open]")) return;
  const control = event.ctrlKey || event.metaKey;
  const key = event.key.toLowerCase();
  if (control && key === "z") {
    event.preventDefault();
    step(event.shiftKey ? "redo" : "undo");
  } else if (control && key === "y") {
    event.preventDefault();
    step("redo");
  } else if (!control && !event.altKey && holds(event)) {
    event.preventDefault();
    hold(true);
  }
});
document.addEventListener("keyup", (event) => holds(event) && hold(false));
addEventListener("blur", () => hold(false));

let lost = false;
on("lost", () => { lost = true; });
on("open", () => {
  if (lost) openPreview();
  lost = false;
});
openEvents();

/** Loads the controls, and again until they are there. */
async function loadControls() {
  try {
    await import("./controls.js");
  } catch {
    toast("The controls could not be loaded", "They are tried again; if they do not come, load the page again");
    setTimeout(loadControls, RETRY_MS);
  }
}

firstPicture().then(loadControls);
