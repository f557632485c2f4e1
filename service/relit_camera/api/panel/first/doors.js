// Who will be seen: three doors for a first visit, and a quiet fourth.

import { call, toast } from "../api.js";
import { store } from "../library/stored.js";
import { on } from "../stage/events.js";
import { ANYONE, onScene, scene, showsNobody } from "../stage/scene.js";
import { comesBack, showUnlit } from "../stage/unlit.js";
import { make } from "../widgets.js";
import { DRAWINGS } from "./drawings.js";
import { problemPlace, showProblem } from "./problem.js";

const CAPTURING = {
  filming: "Measuring your face: look at the camera and hold still…",
  building: "Making you of what was filmed: some seconds…",
};

const section = document.getElementById("doors");
section.setAttribute("aria-labelledby", "doors-title");
section.innerHTML = `
  <header>
    <h2 id="doors-title" tabindex="-1">Who will be seen?</h2>
    <p id="doors-now"></p>
  </header>
  <ul class="doors">
    ${door("face", "My face now", "Look into the webcam for three seconds. You are lit in less than half a minute.")}
    ${door("demo", "The demo person", "At once, and moved by your face. Rendered: they do not exist.")}
    ${door("file", "Open a file", "Somebody captured before: a file that ends in .relit.")}
  </ul>
  <input type="file" id="door-file-input" accept=".relit" hidden>
  <p id="doors-state" class="hint" role="status"></p>
  <p class="buttons">
    <button type="button" class="quiet" id="door-anyone">Relight my live picture</button>
    <button type="button" class="quiet" id="door-unlit">Show me unlit…</button>
    <button type="button" class="quiet" id="doors-close" hidden>Close</button>
  </p>`;
const problem = problemPlace("doors-problem");
section.querySelector(".doors").after(problem);
const byId = (id) => document.getElementById(id);

function door(id, title, words) {
  return `<li><button type="button" class="door" id="door-${id}" aria-labelledby="door-${id}-title" aria-describedby="door-${id}-words">
    ${DRAWINGS[id]}<strong id="door-${id}-title">${title}</strong><span id="door-${id}-words">${words}</span></button></li>`;
}

let capturing = false;
let opened = false;
let opener = "";

/** Shows the doors, whoever is seen now, and moves the keyboard there. */
export function openDoors() {
  opener = document.activeElement?.id ?? "";
  opened = true;
  draw();
  byId("doors-title").focus();
}

/** Begins the capture of one's own face, with help to sit well. */
export async function captureFace() {
  showProblem(problem, null);
  const from = document.activeElement?.id;
  const face = await import("./face.js").catch(() => null);
  if (!face) return toast("This part of the panel could not be loaded", "Try again; if it does not help, load the page again");
  if (await face.openFaceDialog()) leave();
  if (document.activeElement === document.body) focusAgain(from);
}

function draw() {
  const now = scene();
  const nobody = now !== null && showsNobody(now) && !now.unlit_allowed && !comesBack();
  const shown = now !== null && (nobody || opened);
  if (section.hidden === !shown) return;
  const inside = section.contains(document.activeElement);
  section.hidden = !shown;
  if (!shown && inside) focusAgain(opener);
}

function drawNow(now) {
  byId("doors-close").hidden = showsNobody(now) && !now.unlit_allowed;
  byId("door-anyone").hidden = now.subject === ANYONE && now.mode === "live";
  byId("doors-now").textContent = whoIsSeen(now);
}

function whoIsSeen(now) {
  if (!showsNobody(now)) return now.subject === ANYONE ? "Others see you, lit as an average head would be." : `Others see “${now.subject}” now.`;
  if (now.unlit_allowed) return "Others see your webcam’s picture, unlit.";
  if (now.subject === ANYONE) return "Portrait moves a picture of you, and there is none yet. Others see a placeholder.";
  return "So far others see a placeholder. Your pictures stay on this computer.";
}

/** The doors have done their work. */
function leave() {
  opened = false;
  draw();
}

/** Moves the keyboard to where it came from; or, where that is gone, to the page's content. */
function focusAgain(id) {
  const from = document.getElementById(id);
  if (from?.checkVisibility()) return from.focus();
  const main = document.querySelector("main");
  main.tabIndex = -1;
  main.focus({ preventScroll: true });
}

/** Does what a door is for; what goes wrong is shown beneath the doors. */
async function pass(work, words) {
  if (section.ariaBusy === "true") return;
  section.ariaBusy = "true";
  showProblem(problem, null);
  byId("doors-state").textContent = words;
  try {
    await work();
    leave();
  } catch (error) {
    showProblem(problem, error);
  }
  byId("doors-state").textContent = "";
  section.ariaBusy = "false";
}

async function showDemo() {
  const { name } = await call("POST", "demo-subject");
  // Another's face than the webcam's: only portrait shows it.
  await call("PATCH", "scene", { subject: name, mode: "portrait", unlit_allowed: false });
}

async function openFile(file) {
  const subject = await store("subjects", file, (share) => {
    byId("doors-state").textContent = `Uploading ${file.name}: ${Math.round(100 * share)} %`;
  });
  await call("PATCH", "scene", { subject, unlit_allowed: false });
}

/** Asks, with the picture that others would see, whether it may be published; only a yes changes anything. */
export function askUnlit() {
  const picture = make("img", { alt: "What others would see, live", width: 640, height: 360, src: `/api/v1/preview.mjpg?before=true&width=640&fps=15&opened=${Date.now()}` });
  const no = make("button", { type: "button", className: "firm", id: "unlit-no", autofocus: true }, "Keep me hidden");
  const yes = make("button", { type: "button", id: "unlit-yes" }, "Show me unlit");
  const wrong = problemPlace("unlit-problem");
  const dialog = make(
    "dialog",
    { id: "unlit-dialog", className: "flow", "aria-labelledby": "unlit-title", "aria-describedby": "unlit-words" },
    make("h2", { id: "unlit-title" }, "Show yourself unlit?"),
    make("div", { className: "mirror" }, picture),
    make("p", { id: "unlit-words" }, "Others will see this picture of your webcam as it is: your face, your room, everything in it. The panel says UNLIT for as long. After a restart you are hidden again."),
    wrong,
    make("p", { className: "actions" }, yes, no),
  );
  no.onclick = () => dialog.close();
  yes.onclick = async () => {
    try {
      await showUnlit();
      leave();
      dialog.close();
    } catch (error) {
      showProblem(wrong, error);
    }
  };
  dialog.onclose = () => {
    picture.removeAttribute("src"); // else it streams on
    dialog.remove();
  };
  document.body.append(dialog);
  dialog.showModal();
}

byId("door-face").onclick = captureFace;
byId("door-demo").onclick = () => pass(showDemo, "Fetching the demo person…");
byId("door-file").onclick = () => byId("door-file-input").click();
byId("door-file-input").onchange = ({ target }) => {
  const [file] = target.files;
  target.value = "";
  if (file) pass(() => openFile(file), `Uploading ${file.name}…`);
};
byId("door-anyone").onclick = () => pass(() => call("PATCH", "scene", { subject: ANYONE, mode: "live", unlit_allowed: false }), "");
byId("door-unlit").onclick = askUnlit;
byId("doors-close").onclick = leave;
section.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !byId("doors-close").hidden) leave();
});

onScene((now) => {
  drawNow(now);
  draw();
});
// A capture that somebody else began, such as `relit run --instant`; perhaps before this page was opened.
function hear({ stage, what, cure }) {
  capturing = stage in CAPTURING;
  if (document.getElementById("face-dialog")) return;
  byId("doors-state").textContent = CAPTURING[stage] ?? "";
  showProblem(problem, stage === "failed" || (what && capturing) ? { what, cure } : null);
}

async function look() {
  const status = await call("GET", "captures/instant").catch(() => null);
  if (status && (capturing || status.stage in CAPTURING)) hear(status);
}

on("capture", hear);
on("open", look);
look();
