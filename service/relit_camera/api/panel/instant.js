// One's own face: the instant capture, from its button to its end.

import { attempt, sentence } from "./api.js";

const HINTS = {
  idle: "Look at the camera for three seconds, in soft light from the front. The pictures stay on this computer.",
  filming: "Look at the camera and hold still…",
  building: "Making your subject: some seconds…",
  canceled: "Canceled. Nothing was stored.",
};

/** The button that begins the capture or cancels it, and the words on how far it is. */
export class InstantCapture {
  #running = false;

  constructor() {
    this.button = document.getElementById("instant");
    this.hint = document.getElementById("instant-hint");
    this.button.onclick = async () => {
      await (this.#running ? attempt("DELETE", "captures/instant") : attempt("POST", "captures/instant", {}));
      await this.load();
    };
  }

  async load() {
    const status = await attempt("GET", "captures/instant");
    if (status) this.show(status);
  }

  show({ stage, subject, what, cure }) {
    this.#running = stage === "filming" || stage === "building";
    this.button.textContent = this.#running ? "Cancel" : "Use my own face";
    if (stage === "done") this.hint.textContent = sentence(what || `this is you, stored as “${subject}”`);
    else if (stage === "failed") this.hint.textContent = `${sentence(what)} ${sentence(cure)}`;
    // While it is tried again, what went wrong the last time stays to be read.
    else this.hint.textContent = (what ? `${sentence(what)} ${sentence(cure)} ` : "") + HINTS[stage];
  }
}
