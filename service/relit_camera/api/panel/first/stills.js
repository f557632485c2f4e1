// Expression stills: half a minute before the webcam, told what to do next, or a video; then what the pictures show.

import { call, sentence } from "../api.js";
import { upload } from "../capture/upload.js";
import { checkFile, LIMITS } from "../library/limits.js";
import { on } from "../stage/events.js";
import { scene } from "../stage/scene.js";
import { make, setAttribute } from "../widgets.js";
import { FramingHelp } from "./framing.js";
import { MODELS_WORDS, ModelPull } from "./models.js";
import { problemPlace, showProblem } from "./problem.js";

const POLL_MS = 250;
const PATH = "captures/expressions";
const RUNNING = ["receiving", "filming", "building"];
const WORDS = {
  models: MODELS_WORDS,
  ready: ["Your own mouth, eyes and cheeks", "Half a minute: do what is asked, and the camera keeps some pictures of you. Then your captured face has your own teeth, lids and turned cheeks. Sit in soft light, alone. Who is in a call with you sees you do it."],
  sending: ["Sending your video", ""],
  filming: ["Do as it says", ""],
  building: ["Thank you. Some seconds more", "The best pictures are chosen, and the light of your room is worked out."],
  done: ["Your face has them now", ""],
  failed: ["That did not work", ""],
};
/** What the camera's names are called here. Right and left are one's own, as in a mirror. */
const LABELS = {
  neutral: "At rest",
  "wide mouth": "Smile",
  "lips apart": "Talking",
  "round mouth": "“Oo”",
  "jaw dropped": "Wide open",
  "eyes shut": "Eyes shut",
  "turned right": "Right",
  "turned far right": "Further right",
  "turned left": "Left",
  "turned far left": "Further left",
};
const SAID = { good: "taken", due: "now", unknown: "not yet", bad: "not taken" };

// One for the page: there is no way to take back what was given to `on`.
const framing = new FramingHelp(on);

/** Opens the dialog for the stored face of that name; answers whether it got stills. */
export async function openStillsDialog(name) {
  return new StillsDialog(name).run();
}

class StillsDialog {
  #step = "";
  #taken = false;
  #sending = null;
  #filming = false; // also where no answer came: a page that is left gives up its requests first

  constructor(name) {
    this.subject = name;
    const button = (id, text, className, work) => {
      const made = make("button", { type: "button", id, className }, text);
      made.onclick = work;
      return made;
    };
    this.title = make("h2", { id: "stills-title", tabIndex: -1 });
    this.words = make("p", { id: "stills-words", role: "status" });
    this.prompt = make("p", { id: "stills-prompt", className: "advice", role: "status" });
    this.items = make("ul", { id: "stills-items", className: "marks", "aria-label": "What the pictures show" });
    this.bar = make("progress", { id: "stills-progress", max: 1, "aria-label": "How far it is" });
    this.problem = problemPlace("stills-problem");
    this.models = new ModelPull("stills-models", () => this.#show("ready"));
    this.file = make("input", { type: "file", id: "stills-file", accept: LIMITS[`${PATH}/video`].endings.join(","), hidden: true });
    this.file.onchange = () => this.#chosen();
    this.video = button("stills-video", "Use a video…", "quiet", () => this.file.click());
    this.cancel = button("stills-cancel", "Cancel", "quiet", () => this.dialog.close());
    this.again = button("stills-again", "Once more", "", () => this.#show("ready"));
    this.moved = button("stills-moved", "Portrait: your captured picture, moved", "", () => this.#showMoved());
    this.start = button("stills-start", "Begin", "firm", () => this.#film());
    this.keep = button("stills-keep", "Done", "firm", () => this.dialog.close());
    this.dialog = make(
      "dialog",
      { id: "stills-dialog", className: "flow", "aria-labelledby": "stills-title" },
      this.title, this.words, framing.view, this.prompt, framing.advice, framing.marks, this.items, this.bar,
      this.models.element, this.problem, this.file,
      make("p", { className: "actions" }, this.video, this.cancel, this.again, this.moved, this.start, this.keep),
    );
  }

  async run() {
    document.body.append(this.dialog);
    const closed = new Promise((resolve) => {
      this.dialog.onclose = resolve;
    });
    const leave = () => this.#filming && fetch(`/api/v1/${PATH}`, { method: "DELETE", keepalive: true });
    addEventListener("pagehide", leave);
    this.dialog.showModal();
    this.#show("ready");
    const models = await call("GET", "models").catch(() => null);
    if (models?.missing.length && this.#step === "ready") {
      this.#show("models");
      this.models.look();
    }
    const now = await call("GET", PATH).catch(() => null);
    // Begun before the page was loaded anew, or by another page
    const same = now?.subject === this.subject && RUNNING.includes(now.stage);
    if (same && this.dialog.open && this.#step === "ready") this.#work(now.stage, () => now);
    await closed;
    removeEventListener("pagehide", leave);
    this.models.stop();
    this.#sending?.abort();
    framing.close();
    this.dialog.remove();
    if (this.#running) await call("DELETE", PATH).catch(() => null);
    return this.#taken;
  }

  get #running() {
    return this.#filming || ["building", "sending"].includes(this.#step); // what was sent whole is worked on already
  }

  #show(step) {
    const [title, words] = WORDS[step];
    this.#step = step;
    this.dialog.dataset.step = step;
    this.title.textContent = title;
    this.words.textContent = words;
    this.words.hidden = !words;
    const ready = step === "ready" || step === "failed";
    framing.view.hidden = ["models", "sending", "building"].includes(step);
    framing.advice.hidden = framing.marks.hidden = !ready;
    this.prompt.hidden = step !== "filming";
    this.items.hidden = step !== "filming" && step !== "done";
    this.bar.hidden = !["filming", "building", "sending"].includes(step);
    this.bar.removeAttribute("value");
    this.models.element.hidden = step !== "models";
    this.start.hidden = this.video.hidden = !ready;
    this.again.hidden = this.keep.hidden = step !== "done";
    this.moved.hidden = step !== "done" || scene()?.mode !== "live" || scene()?.subject !== this.subject;
    this.cancel.hidden = step === "done";
    this.start.textContent = step === "failed" ? "Try again" : "Begin";
    if (step !== "failed") showProblem(this.problem, null);
    if (ready && !framing.running) framing.start();
    if (!ready) framing.stop();
    if (step === "filming") framing.showFilmed();
    (step === "done" ? this.keep : ready ? this.start : this.title).focus();
  }

  #film() {
    this.#work("filming", () => call("POST", PATH, { subject: this.subject }));
  }

  #chosen() {
    const [file] = this.file.files;
    this.file.value = "";
    if (!file) return;
    this.#work("sending", () => {
      checkFile(file, `${PATH}/video`);
      const form = new FormData();
      form.append("subject", this.subject);
      form.append("file", file); // the last one: it is written as it comes
      this.#sending = new AbortController();
      return upload(`${PATH}/video`, form, (share) => { this.bar.value = share; }, this.#sending.signal);
    });
  }

  /** Shows how far the capture is that `begin` begins, until it ends. */
  async #work(step, begin) {
    this.#show(step);
    this.#filming = step === "filming";
    try {
      let status = await begin();
      this.#sending = null;
      if (!this.dialog.open) return;
      while (RUNNING.includes(status.stage)) {
        this.#filming = status.stage === "filming";
        if (status.stage !== this.#step) this.#show(status.stage);
        this.#tell(status);
        await new Promise((resolve) => setTimeout(resolve, POLL_MS));
        if (!this.dialog.open) return;
        status = await call("GET", PATH);
      }
      this.#filming = false;
      if (!this.dialog.open) return;
      if (status.stage === "failed") throw status;
      if (status.stage !== "done") return this.#show("ready"); // canceled elsewhere
      this.#taken = true;
      this.#show("done");
      this.#report(status);
    } catch (error) {
      this.#sending = null;
      if (error.status) this.#filming = false;
      if (!this.dialog.open) return;
      this.#show("failed");
      showProblem(this.problem, error);
    }
  }

  #tell(status) {
    if (status.stage === "building" && !status.film) return; // some seconds, as long as they take
    this.bar.value = status.progress;
    const seen = status.face ? sentence(status.say) : "I cannot see your face: look into the camera.";
    const say = status.prompt ? seen : "One moment…"; // before the first frame, and after the last
    if (this.prompt.textContent !== say) this.prompt.textContent = say;
    setAttribute(framing.view, "data-state", status.face ? "good" : "bad");
    this.#mark(status, (name) => (status.covered.includes(name) ? "good" : name === status.prompt ? "due" : "unknown"));
  }

  #mark({ items }, stateOf) {
    if (this.items.children.length !== items.length) {
      this.items.replaceChildren(...items.map((name) => make("li", {}, LABELS[name] ?? name, make("span", { className: "unseen" }))));
    }
    items.forEach((name, index) => {
      const mark = this.items.children[index];
      const state = stateOf(name);
      if (mark.dataset.state === state) return;
      mark.dataset.state = state;
      mark.lastElementChild.textContent = `: ${SAID[state]}`;
    });
  }

  #report(status) {
    const { stills, covered, missing } = status.report;
    this.#mark(status, (name) => (covered.includes(name) ? "good" : "bad"));
    const told = [`${stills} pictures were taken for “${status.subject}”.`];
    if (status.what) told.push(sentence(status.what));
    if (!this.moved.hidden) told.push("They show with “Portrait: your captured picture, moved”; now “Live picture, relit” is chosen.");
    if (missing.length) told.push(`For more, go through it once more and ${missing.join("; ")}.`);
    this.words.textContent = told.join(" ");
    this.words.hidden = false;
    framing.showRelit();
  }

  async #showMoved() {
    try {
      await call("PATCH", "scene", { mode: "portrait" });
      this.moved.hidden = true;
      this.keep.focus();
    } catch (error) {
      showProblem(this.problem, error);
    }
  }
}
