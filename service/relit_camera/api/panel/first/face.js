// My face now: help to sit well, three seconds of the webcam, then the relit picture.

import { call, sentence } from "../api.js";
import { on } from "../stage/events.js";
import { make } from "../widgets.js";
import { FramingHelp } from "./framing.js";
import { MODELS_WORDS, ModelPull } from "./models.js";
import { problemPlace, showProblem } from "./problem.js";

const POLL_MS = 300;
const WORDS = {
  models: MODELS_WORDS,
  framing: ["Your face now", ""],
  filming: ["Hold still", "Look at the camera, your mouth closed."],
  building: ["Working out your light", "A few seconds…"],
  done: ["That is you, in another light", ""],
  failed: ["That did not work", ""],
};

/** Opens the dialog; answers whether one's own face is shown when it closes. */
export async function openFaceDialog() {
  const dialog = new FaceDialog();
  return dialog.run();
}

/** Begins a capture, or joins the one that runs; takes over one that only waits to try again. */
async function begin() {
  try {
    return await call("POST", "captures/instant", {});
  } catch (error) {
    if (error.status !== 409) throw error;
  }
  const status = await call("GET", "captures/instant");
  if (status.stage === "filming" || status.stage === "building") return status;
  await call("DELETE", "captures/instant");
  return call("POST", "captures/instant", {});
}

// One for the page: there is no way to take back what was given to `on`.
const framing = new FramingHelp(on);

class FaceDialog {
  #step = "";
  #captured = false;

  constructor() {
    const button = (id, text, className, work) => {
      const made = make("button", { type: "button", id, className }, text);
      made.onclick = work;
      return made;
    };
    this.title = make("h2", { id: "face-title", tabIndex: -1 });
    this.words = make("p", { id: "face-words", role: "status" });
    this.bar = make("div", { className: "filming-bar", "aria-hidden": "true" });
    this.problem = problemPlace("face-problem");
    this.models = new ModelPull("face-models", () => this.#show("framing"));
    this.cancel = button("face-cancel", "Cancel", "quiet", () => this.dialog.close());
    this.again = button("face-again", "Once more", "", () => this.#show("framing"));
    this.start = button("face-start", "Capture me", "firm", () => this.#capture());
    this.keep = button("face-keep", "Keep it", "firm", () => this.dialog.close());
    framing.view.append(this.bar);
    this.dialog = make(
      "dialog",
      { id: "face-dialog", className: "flow", "aria-labelledby": "face-title" },
      this.title, this.words, framing.view, framing.advice, framing.marks, this.models.element, this.problem,
      make("p", { className: "actions" }, this.cancel, this.again, this.start, this.keep),
    );
  }

  async run() {
    document.body.append(this.dialog);
    const closed = new Promise((resolve) => {
      this.dialog.onclose = resolve;
    });
    this.dialog.showModal();
    this.#show("framing");
    const models = await call("GET", "models").catch(() => null);
    if (models?.missing.length) {
      this.#show("models");
      this.models.look();
    }
    await closed;
    this.models.stop();
    framing.close();
    this.bar.remove();
    this.dialog.remove();
    if (this.#step === "filming" || this.#step === "building") await call("DELETE", "captures/instant").catch(() => null);
    return this.#captured;
  }

  #show(step) {
    const [title, words] = WORDS[step];
    this.#step = step;
    this.dialog.dataset.step = step;
    this.title.textContent = title;
    this.words.textContent = words;
    this.words.hidden = !words;
    const live = step === "framing" || step === "failed";
    framing.view.hidden = step === "models";
    framing.advice.hidden = framing.marks.hidden = !live;
    this.bar.hidden = step !== "filming";
    this.models.element.hidden = step !== "models";
    this.start.hidden = !live;
    this.again.hidden = step !== "done";
    this.keep.hidden = step !== "done";
    this.cancel.hidden = step === "done";
    this.start.textContent = step === "failed" ? "Try again" : "Capture me";
    if (step !== "failed") showProblem(this.problem, null);
    if (live && !framing.running) framing.start();
    if (!live) framing.stop();
    (step === "done" ? this.keep : live ? this.start : this.title).focus();
  }

  async #capture() {
    this.#show("filming");
    try {
      let status = await begin();
      while (status.stage === "filming" || status.stage === "building") {
        if (status.stage !== this.#step) this.#show(status.stage);
        await new Promise((resolve) => setTimeout(resolve, POLL_MS));
        if (!this.dialog.open) return;
        status = await call("GET", "captures/instant");
      }
      if (status.stage === "failed") throw status;
      if (status.stage !== "done") return this.#show("framing"); // canceled elsewhere
      this.#captured = true;
      await call("PATCH", "scene", { unlit_allowed: false }); // who is relit is not to be shown as filmed later
      this.#show("done");
      framing.showRelit();
      this.words.textContent = status.what ? sentence(status.what) : "Others see this now, the right way round.";
      this.words.hidden = false;
    } catch (error) {
      if (!this.dialog.open) return;
      this.#show("failed");
      showProblem(this.problem, error);
    }
  }
}
