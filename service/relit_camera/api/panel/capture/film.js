// The film capture: what to prepare, the upload, how far the work is, and the report to act on.

import { call, sentence } from "../api.js";
import { showProblem } from "../first/problem.js";
import { checkFile } from "../library/limits.js";
import { on, openEvents } from "../stage/events.js";
import { make } from "../widgets.js";
import { coverageBall } from "./coverage.js";
import { Steps } from "./steps.js";
import { upload } from "./upload.js";

const VERDICTS = { good: "Good", usable: "Usable", again: "Better film again" };
const TITLES = {
  receiving: "The film is being sent",
  reading: "Reading the film",
  building: "Making your face",
  failed: "That did not work",
  canceled: "Stopped",
  interrupted: "Interrupted",
};
const WORDS = {
  receiving: "From another page of the panel.",
  reading: "A few minutes. You may close this page and come back: the work goes on.",
  building: "Nearly there. You may close this page and come back: the work goes on.",
  failed: "Nothing was stored.",
  canceled: "Nothing was stored. The film is still here.",
  interrupted: "The camera ended meanwhile. What was done is kept.",
};
const RUNNING = ["receiving", "reading", "building"];
const STATES = { waiting: "waiting", running: "now", done: "done" };
const FIELDS = {
  "--focal-px": "“Focal length”",
  "--ball": "“Where the ball is”",
  "--second-ball": "“Where the second ball is”",
  "--face": "“Where the face is”",
  "--balls": "“two balls”",
  "--ball-diameter-cm": "“The ball’s width”",
  "--light-distance-cm": "“From lamp to face”",
};
const $ = (id) => document.getElementById(id);

let sending = null;
let last = null; // what the camera has told last

const steps = new Steps(["warning", "prepare", "film", "upload", "work", "report"], ["warning", "prepare", "film", "upload"]);

/** Words that are meant for the command line, with the names that its options have on this page. */
function forPage(words) {
  const named = words.replace(/`?(--[a-z-]+)( 2| [0-9.]+| X,Y,RADIUS)?`?/g, (text, option) => FIELDS[option] ?? text);
  return named.replace("run `relit models pull`", "get the models in the panel");
}

// The upload

/** How to read the film, as the page says it. */
function options() {
  const circles = ["ball", "second_ball", "face"].map((id) => [id, $(id).value.replace(/\s/g, "")]);
  const said = [["light_distance_cm", $("light-distance").value], ["ball_diameter_cm", $("ball-diameter").value], ["balls", $("balls").value], ["focal_px", $("focal").value], ...circles];
  return Object.fromEntries(said.filter(([, value]) => value !== ""));
}

function form() {
  const made = new FormData();
  made.append("name", $("film-name").value.trim());
  for (const [name, value] of Object.entries(options())) made.append(name, value);
  made.append("file", $("film-file").files[0]); // the last one: it is written as it comes
  return made;
}

/** Puts the options where they can be said: with the upload, or where a film is to be read again. */
function placeOptions(again) {
  const details = $("film-options");
  if (again) $("options-again").append(details);
  else $("upload-problem").before(details);
}

function showSending(on) {
  const held = document.activeElement === (on ? $("film-upload") : $("upload-cancel"));
  $("upload-state").hidden = !on;
  $("upload-cancel").hidden = !on;
  $("upload-back").hidden = on;
  $("film-upload").hidden = on;
  for (const field of $("upload-form").querySelectorAll("input, select")) field.disabled = on;
  if (held) (on ? $("upload-cancel") : $("film-upload")).focus();
}

/** Whether the camera would take the film, which is said before it is sent. */
function checkFilm() {
  const [film] = $("film-file").files;
  try {
    if (film) checkFile(film, "captures/film");
    showProblem($("upload-problem"), null);
    return true;
  } catch (error) {
    showProblem($("upload-problem"), error);
    return false;
  }
}

async function send() {
  const body = form();
  const megabytes = $("film-file").files[0].size / 1e6;
  sending = new AbortController();
  showProblem($("upload-problem"), null);
  showSending(true);
  const progress = (share) => {
    $("upload-progress").value = share;
    $("upload-words").textContent = `${Math.round(share * megabytes)} of ${Math.round(megabytes)} MB`;
  };
  progress(0);
  try {
    const status = await upload("captures/film", body, progress, sending.signal);
    sending = null;
    showSending(false);
    show(status);
  } catch (error) {
    showProblem($("upload-problem"), sending.signal.aborted ? null : error);
    sending = null;
    showSending(false);
  }
}

/** The options as JSON has them: all but circles are numbers. */
function numbers(said) {
  return Object.fromEntries(Object.entries(said).map(([name, value]) => [name, value.includes(",") ? value : Number(value)]));
}

// The work

/** Shows what the camera tells while it works, and to who waits for it; else only leads there, from the first step. */
function hear(status) {
  const news = steps.current === "work" && status.stage !== last?.stage;
  if (RUNNING.includes(status.stage) || news) return show(status);
  offer(status);
}

function offer(status) {
  last = status;
  $("film-last").hidden = status.stage === "idle" || RUNNING.includes(status.stage);
  $("film-last-open").textContent = status.stage === "done" ? "The report of your last film" : "Back to your last film";
}

/** Shows how far the capture is: its work, or its report. */
function show(status) {
  if (sending) return; // this page knows better how far it is
  offer(status);
  if (status.stage === "idle") return;
  if (status.stage === "done") return showReport(status);
  const running = RUNNING.includes(status.stage);
  $("work-title").textContent = TITLES[status.stage];
  say($("work-words"), WORDS[status.stage]);
  $("work-progress").hidden = !running;
  $("work-progress").value = status.progress;
  showStages(status.stages);
  showProblem($("film-problem"), status.stage === "failed" ? { what: forPage(status.what), cure: forPage(status.cure) } : null);
  const held = ["film-cancel", "film-resume", "film-other", "film-forget"].includes(document.activeElement?.id);
  $("film-cancel").hidden = !running;
  $("film-resume").hidden = running || !status.can_resume;
  $("film-resume").textContent = status.stage === "failed" ? "Try again" : "Go on";
  $("film-forget").hidden = running || !status.can_resume;
  $("film-other").hidden = running;
  placeOptions(status.stage === "failed" && status.can_resume);
  steps.show("work", true);
  if (held && document.activeElement === document.body) $("work-title").focus();
}

function say(place, words) {
  if (place.textContent !== words) place.textContent = words;
}

function showStages(stages) {
  const items = stages.map(({ name, state, seconds }) => {
    const time = state === "waiting" ? "" : `${Math.round(seconds)} s`;
    const item = make("li", {}, make("span", {}, sentence(name).replace(/\.$/, "")), make("span", { className: "hint" }, time), make("span", { className: "unseen" }, STATES[state]));
    Object.assign(item.dataset, { stage: name, state });
    return item;
  });
  $("film-stages").replaceChildren(...items);
}

async function ask(method, path, body) {
  try {
    show(await call(method, path, body));
  } catch (error) {
    showProblem($("film-problem"), error);
  }
}

// The report

function showReport({ subject, report }) {
  $("film-verdict").dataset.verdict = report.verdict;
  $("film-verdict").textContent = VERDICTS[report.verdict];
  $("film-because").textContent = sentence(forPage(report.because));
  const pictures = report.pictures.map((path) => {
    const place = path.replace(/.*\/|\.jpg.*/g, "").replaceAll("-", " ");
    return make("li", {}, make("img", { src: path, alt: "You, relit" }), make("p", { className: "hint" }, sentence(place).replace(/\.$/, "")));
  });
  $("film-pictures").replaceChildren(...pictures);
  const covered = `${Math.round(100 * report.covered_fraction)} %`;
  const facts = [
    ["Directions of light", String(report.directions)],
    ["Space before your face", covered],
    ["Expected quality", report.expected_db === null ? "not known" : `${Math.round(report.expected_db)} dB`],
    ["Frames used", `${report.used} of ${report.frames}`],
    ...(report.coda ? [["Your own mouth and eyes", sentence(forPage(report.coda))]] : []),
  ];
  $("film-facts").replaceChildren(...facts.flatMap(([term, value]) => [make("dt", {}, term), make("dd", {}, value)]));
  $("coverage")?.remove();
  $("coverage-figure").hidden = !report.lights?.length;
  if (report.lights?.length) $("coverage-figure").prepend(coverageBall(report.lights, `${report.directions} directions of light, over ${covered} of the space before your face`));
  $("film-dropped").replaceChildren(...fold(report));
  $("film-use").dataset.subject = subject;
  $("film-use").className = report.verdict === "again" ? "" : "firm";
  $("film-again").className = report.verdict === "again" ? "firm" : "";
  steps.show("report", true);
}

/** What was left out and why, and the warnings. */
function fold({ dropped, warnings }) {
  const lists = [];
  if (warnings.length) lists.push(make("h3", {}, "What could be better"), make("ul", { className: "plain" }, ...warnings.map((words) => make("li", {}, sentence(forPage(words))))));
  if (dropped.length) lists.push(make("h3", {}, "Frames that were not used"), make("ul", { className: "plain" }, ...dropped.map(({ count, why }) => make("li", {}, `${count}: ${forPage(why)}`))));
  return lists;
}

async function use() {
  try {
    await call("PATCH", "scene", { subject: $("film-use").dataset.subject, mode: "live", unlit_allowed: false });
    location.assign("/");
  } catch (error) {
    showProblem($("use-problem"), error);
  }
}

function openUpload() {
  placeOptions(false);
  steps.show("upload", true);
}

// Buttons

$("understood").onchange = () => {
  $("accept").disabled = !$("understood").checked;
};
$("accept").onclick = () => steps.show("prepare");
$("film-last-open").onclick = () => show(last);
$("have-film").onclick = () => steps.show("upload");
$("prepare-next").onclick = () => steps.show("film");
$("film-next").onclick = () => steps.show("upload");
$("upload-form").onsubmit = (event) => {
  event.preventDefault();
  if (checkFilm()) send();
};
$("film-file").onchange = checkFilm;
$("upload-cancel").onclick = () => sending?.abort();
$("film-cancel").onclick = () => ask("DELETE", "captures/film");
$("film-resume").onclick = () => {
  const again = $("options-again").contains($("film-options")); // failed: as it was said it would fail again
  if (again && [...$("film-options").querySelectorAll("input")].some((field) => !field.reportValidity())) return;
  ask("POST", "captures/film/resume", again ? numbers(options()) : undefined);
};
$("film-forget").onclick = async () => {
  try {
    await call("DELETE", "captures/film?forget=true");
    openUpload();
  } catch (error) {
    showProblem($("film-problem"), error);
  }
};
$("film-other").onclick = openUpload;
$("film-use").onclick = use;
$("film-again").onclick = () => steps.show("film");

// A field that is wrong is shown, also where it is folded away.
document.addEventListener("invalid", ({ target }) => target.closest("details")?.setAttribute("open", ""), true);
addEventListener("beforeunload", (event) => {
  if (sending) event.preventDefault(); // the browser asks whether the upload shall end
});

steps.show("warning");
on("film-capture", hear);
// At the start, and where events were missed.
on("open", async () => {
  const status = await call("GET", "captures/film").catch(() => null);
  if (status) hear(status);
});
openEvents();
