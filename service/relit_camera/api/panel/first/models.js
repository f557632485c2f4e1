// Getting the public models: a button, how far it is, and what went wrong.

import { call, sentence } from "../api.js";
import { make } from "../widgets.js";
import { problemPlace, showProblem } from "./problem.js";

const POLL_MS = 700;
/** Title and words of a dialog that first needs the models. */
export const MODELS_WORDS = ["First, what finds your face", "Small networks find your face in the picture: some 19 MB from their authors, or 36 from a package index. Nothing of you is sent."];

/** A button that gets the models. `prefix` begins its ids; `onDone` is called when none is missing. */
export class ModelPull {
  #timer = 0;

  constructor(prefix, onDone) {
    this.onDone = onDone;
    this.button = make("button", { type: "button", className: "firm", id: `${prefix}-get` }, "Get the models");
    this.cancel = make("button", { type: "button", className: "quiet", id: `${prefix}-cancel`, hidden: true }, "Stop");
    this.bar = make("progress", { id: `${prefix}-progress`, max: 1, hidden: true, "aria-label": "Getting the models" });
    this.doing = make("p", { className: "hint", role: "status" });
    this.problem = problemPlace(`${prefix}-problem`);
    const buttons = make("div", { className: "buttons" }, this.button, this.cancel);
    this.element = make("div", { className: "pull" }, buttons, this.bar, this.doing, this.problem);
    this.button.onclick = () => this.#ask("POST");
    this.cancel.onclick = () => this.#ask("DELETE");
  }

  /** Shows how far the pull is, and follows it while it runs. */
  async look() {
    await this.#ask("GET");
  }

  stop() {
    clearTimeout(this.#timer);
  }

  async #ask(method) {
    this.stop();
    try {
      this.#show(await call(method, "models"));
    } catch (error) {
      showProblem(this.problem, error);
      if (this.bar.hidden) return;
      this.stop();
      this.#timer = setTimeout(() => this.look(), POLL_MS); // what is being got may go on all the same
    }
  }

  #show({ stage, missing, progress, doing, what, cure }) {
    const running = stage === "pulling";
    const held = document.activeElement === (running ? this.button : this.cancel);
    this.button.hidden = running;
    this.cancel.hidden = !running;
    this.bar.hidden = !running;
    this.bar.value = progress;
    this.doing.textContent = running && doing ? sentence(doing) : "";
    showProblem(this.problem, stage === "failed" ? { what, cure } : null);
    if (held) (running ? this.cancel : this.button).focus();
    if (running) this.#timer = setTimeout(() => this.look(), POLL_MS);
    else if (missing.length === 0) this.onDone();
  }
}
