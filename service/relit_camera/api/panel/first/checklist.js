// What the camera needs of this computer and does not find, with the cure; gone by itself when all is there.

import { call, sentence, toast } from "../api.js";
import { on } from "../stage/events.js";
import { make } from "../widgets.js";
import { ModelPull } from "./models.js";

const RELOAD_MS = 4000;
const COPIED_MS = 2000;
const NEEDED = ["source-failed", "sink-failed", "models-missing"];
const MODELS_MISSING = "The small networks that find your face are not here yet: some 19 MB, or 36 from a package index.";
const NUMBERS = ["Nothing is", "One thing is", "Two things are", "Three things are", "Four things are"];

const section = document.getElementById("checklist");
section.setAttribute("aria-labelledby", "checklist-title");
section.innerHTML = `
  <h2 id="checklist-title" tabindex="-1"></h2>
  <p>The camera runs all the same. What you mend goes from this list by itself.</p>
  <ul id="checks"></ul>
  <p class="buttons"><button type="button" class="quiet" id="checks-again">Look again</button></p>`;
const byId = (id) => document.getElementById(id);
const models = new ModelPull("models", () => load());

let drawn = "";
let timer = 0;
let codes = null;
let degradations = [];

/** Asks what is missing, and again while something is. */
async function load() {
  clearTimeout(timer);
  try {
    show(await call("GET", "checks"));
  } catch ({ status }) {
    if (status) show(degradations.filter(({ code }) => NEEDED.includes(code)).map(asCheck)); // else the camera is away
  }
  if (!section.hidden && !document.hidden) timer = setTimeout(load, RELOAD_MS);
}

/** What works less well, in place of the checks where they themselves fail. */
function asCheck({ code, what, why, cure }) {
  return { id: code === "models-missing" ? "models" : code, title: sentence(what).slice(0, -1), state: "failed", what: why, cure, commands: [] };
}

function show(checks) {
  const text = JSON.stringify(checks);
  if (text === drawn) return; // so that a button is not replaced under somebody's hand
  drawn = text;
  const failed = checks.filter((check) => check.state === "failed");
  const wasShown = !section.hidden;
  const inside = section.contains(document.activeElement) ? document.activeElement.id : null;
  section.hidden = failed.length === 0;
  if (section.hidden) {
    models.stop();
    if (wasShown) toast("all that was missing is there now");
    if (inside !== null) focusMain();
    return;
  }
  byId("checklist-title").textContent = `${NUMBERS[failed.length] ?? `${failed.length} things are`} missing`;
  const others = [
    fold("Could be better", checks.filter((check) => check.state === "warning" || check.state === "unknown")),
    fold("Fine", checks.filter((check) => check.state === "ok")),
  ];
  byId("checks").replaceChildren(...failed.map(item), ...others.filter(Boolean));
  if (inside !== null) (byId(inside) ?? byId("checklist-title")).focus();
}

/** Items that need nobody's attention, folded away under their names. */
function fold(title, checks) {
  if (checks.length === 0) return null;
  const names = checks.map((check) => check.title).join(", ");
  return make("li", { className: "folded" }, make("details", {}, make("summary", {}, make("strong", {}, `${title}: `), names), make("ul", {}, ...checks.map(item))));
}

function item({ id, title, state, what, cure, commands }) {
  const missing = id === "models" && state === "failed";
  const parts = [make("h3", {}, title), make("p", {}, missing ? MODELS_MISSING : sentence(what))];
  if (state !== "ok") {
    if (id === "models") {
      models.look();
      parts.push(models.element);
    }
    else if (cure) parts.push(make("p", { className: "cure" }, sentence(withoutCommands(cure, commands))));
    parts.push(...commands.map((text, index) => command(text, `copy-${id}-${index}`)));
  }
  const element = make("li", { className: "check" }, ...parts);
  Object.assign(element.dataset, { check: id, state });
  return element;
}

/** The cure's words; its commands stand below them. */
function withoutCommands(cure, commands) {
  const said = "run the command below";
  return commands.reduce((words, text) => words.replace(`run: ${text}`, said).replace(text, said), cure);
}

function command(text, id) {
  const button = make("button", { type: "button", id, className: "quiet", "aria-label": `Copy the command: ${text}` }, "Copy");
  button.onclick = async () => {
    try {
      await navigator.clipboard.writeText(text);
      button.textContent = "Copied";
    } catch {
      getSelection().selectAllChildren(code); // without a secure context there is no clipboard: the person copies it
      button.textContent = "Press Ctrl-C";
    }
    setTimeout(() => {
      button.textContent = "Copy";
    }, COPIED_MS);
  };
  const code = make("code", { tabIndex: 0 }, text);
  return make("div", { className: "command" }, code, button);
}

function focusMain() {
  const main = document.querySelector("main");
  main.tabIndex = -1;
  main.focus({ preventScroll: true });
}

byId("checks-again").onclick = load;
document.addEventListener("visibilitychange", () => {
  if (!document.hidden) load();
});
// What works less well than it should has changed: perhaps for want of something.
on("status", ({ degraded }) => {
  degradations = degraded;
  const now = degraded.map(({ code }) => code).join();
  if (now === codes) return;
  codes = now;
  load();
});
