// How the camera does: its state, who uses it, what works less well than asked, and its rates.

import { attempt, sentence } from "../api.js";
import { on } from "../stage/events.js";
import { make, setText } from "../widgets.js";

const STATES = {
  starting: "Starting…",
  live: "Live",
  searching: "Looking for your face",
  "standing-in": "Your captured face stands in",
  waiting: "Waiting for the webcam",
  released: "Webcam released until somebody looks",
  capturing: "Nobody is shown yet",
  "no-subject": "Nobody is shown yet",
  "other-person": "Somebody else’s portrait is not shown",
  frozen: "Frozen",
  stopping: "Stopping…",
  lost: "Not connected",
};
const VEILED = ["waiting", "lost", "starting", "capturing"];
/** Where a placeholder is shown, a rate of pictures would only worry. */
const STILL = ["waiting", "released", "starting", "capturing", "no-subject", "other-person"];
const LOST_TEXT = "The camera does not answer. Start it again: relit run. This page finds it by itself.";
const UNLIT_TEXT = "Others see your webcam’s picture as it is.";

const byId = (id) => document.getElementById(id);
let noted = "";
let advised = "";

function showState(state) {
  byId("state").dataset.state = state;
  setText(byId("state-text"), STATES[state] ?? sentence(state));
  const shown = state === "waiting" && byId("preview").naturalWidth > 0;
  byId("veil").hidden = !VEILED.includes(state) || shown;
  setText(byId("veil"), STATES[state] ?? "");
  document.body.classList.toggle("lost", state === "lost");
}

function showReaders({ count, names } = { count: null, names: [] }) {
  const readers = byId("readers");
  readers.hidden = count === null;
  readers.classList.toggle("used", count > 0);
  const who = names.length ? names.join(", ") : `${count} program${count === 1 ? "" : "s"}`;
  setText(readers, count > 0 ? `In use by ${who}` : "Not in use by any app");
}

function showUnlit(unlit) {
  byId("unlit").hidden = !unlit;
  setText(byId("unlit-text"), unlit ? UNLIT_TEXT : "");
  document.body.classList.toggle("is-unlit", Boolean(unlit));
}

function showNotes(degraded) {
  const stands = JSON.stringify(degraded);
  if (stands === noted) return;
  noted = stands;
  const notes = degraded.map(({ code, what, why, cure }) =>
    make("li", { className: `note-${code}` }, make("strong", {}, sentence(what)), ` ${sentence(why)}`, ...(cure ? [make("em", {}, sentence(cure))] : [])),
  );
  byId("notes").replaceChildren(...notes);
  byId("notes").hidden = notes.length === 0;
}

function showAdvice(advice) {
  const stands = JSON.stringify(advice ?? null);
  if (stands === advised) return;
  advised = stands;
  byId("advice").hidden = !advice;
  if (!advice) return;
  const { what, width, height } = advice;
  const use = make("button", { type: "button" }, `Use ${width} × ${height}`);
  use.onclick = () => attempt("PATCH", "source", { width, height });
  byId("advice").replaceChildren(make("strong", {}, sentence(what)), " ", use);
}

function showStatus(status) {
  showState(status.state);
  showReaders(status.readers);
  byId("readers").title = status.sink.startsWith("camera ") ? `Apps find the camera here: ${status.sink.slice(7)}` : "";
  showUnlit(status.unlit);
  // The advice and the doors say the same, with the buttons that cure it.
  showNotes(status.degraded.filter(({ code }) => code !== "no-subject" && !(status.advice && code === "reduced-quality")));
  showAdvice(status.advice);
  const rate = (value) => (value ?? 0).toFixed(0);
  setText(byId("figure-fps"), STILL.includes(status.state) ? "" : `${rate(status.fps.new)} pictures a second`);
  byId("figure-fps").title = `New ones; the webcam gives ${rate(status.fps.camera)}`;
  setText(byId("figure-latency"), `${Math.round(status.latency_ms.p50)} ms behind, mostly below ${Math.round(status.latency_ms.p95)} ms`);
  setText(byId("figure-tracker"), `Face ${status.tracker.state}`);
}

on("status", showStatus);
on("lost", ({ refused }) => {
  showState("lost");
  setText(byId("veil"), LOST_TEXT);
  showReaders();
  showUnlit(false); // what was true of the pictures of a camera that is no longer there
  for (const figure of ["figure-fps", "figure-latency", "figure-tracker"]) setText(byId(figure), "");
  if (refused) attempt("GET", "mode"); // which finds out whether the token is needed again
});
on("caption", ({ text }) => {
  setText(byId("caption"), text);
  byId("caption").hidden = !text;
});
on("open", () => {
  setText(byId("caption"), "");
  byId("caption").hidden = true;
});
