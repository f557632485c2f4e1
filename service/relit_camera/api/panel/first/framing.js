// Live help to sit well before the webcam: the picture as filmed, the face in it, and the one thing to do.

import { call, sentence } from "../api.js";
import { make } from "../widgets.js";

const RENEW_MS = 5000; // what was asked for ends ten seconds after the last request
const SILENT_MS = 3000;
const MARKS = { distance: "Distance", position: "Position", light: "Light", sharpness: "Sharpness", exposure: "Exposure" };
const SAID = { good: "good", bad: "not yet", unknown: "not known" };
const FACES = {
  none: "Sit before the webcam, so that it sees your face.",
  several: "Be alone in the picture; a poster of a face counts, too.",
};

/** The picture and its marks. `on(kind, callback)` hears server-sent events. */
export class FramingHelp {
  #renewal = 0;
  #heard = 0;

  constructor(on) {
    this.picture = make("img", { id: "face-picture", alt: "Your webcam’s picture, which only you see here", width: 640, height: 360 });
    this.box = make("div", { className: "face-box", hidden: true });
    this.view = make("div", { className: "mirror" }, this.picture, this.box);
    this.advice = make("p", { id: "face-advice", className: "advice", role: "status" });
    this.marks = make("ul", { id: "framing", className: "marks", "aria-label": "How you sit" });
    for (const [of, label] of Object.entries(MARKS)) {
      const mark = make("li", {}, label, make("span", { className: "unseen" }));
      Object.assign(mark.dataset, { of, state: "unknown" });
      this.marks.append(mark);
    }
    on("framing", (framing) => this.#show(framing));
  }

  get running() {
    return this.#renewal !== 0;
  }

  /** Shows the webcam's picture and judges it, until `stop`. */
  start() {
    this.stop();
    this.showFilmed();
    this.advice.textContent = "Looking for your face…";
    this.#heard = performance.now();
    this.#renewal = setInterval(() => this.#renew(), RENEW_MS);
    this.#renew();
  }

  stop() {
    if (this.running) call("PUT", "framing", { wanted: false }).catch(() => null);
    clearInterval(this.#renewal);
    this.#renewal = 0;
    this.box.hidden = true;
  }

  /** The picture as filmed, which nobody else sees. */
  showFilmed() {
    this.picture.src = `/api/v1/preview.mjpg?before=true&mirror=true&width=640&fps=15&opened=${Date.now()}`;
  }

  /** The picture as others see it. */
  showRelit() {
    this.picture.src = `/api/v1/preview.mjpg?mirror=true&width=640&fps=15&opened=${Date.now()}`;
  }

  close() {
    this.stop();
    this.picture.removeAttribute("src");
  }

  async #renew() {
    try {
      await call("PUT", "framing", { wanted: true });
      if (this.running && performance.now() - this.#heard > SILENT_MS) this.#show(await call("GET", "framing"));
    } catch (error) {
      if (this.running) this.#say(`${sentence(error.what)} ${error.cure ? sentence(error.cure) : ""}`);
    }
  }

  #show(framing) {
    if (!this.running) return;
    this.#heard = performance.now();
    for (const mark of this.marks.children) {
      const { state, advice } = framing[mark.dataset.of];
      const kind = state === "good" || state === "unknown" ? state : "bad";
      if (mark.dataset.state === kind) continue;
      mark.dataset.state = kind;
      mark.title = advice;
      mark.lastElementChild.textContent = `: ${SAID[kind]}`;
    }
    const [left, top, width, height] = framing.box ?? [0, 0, 0, 0];
    this.box.hidden = !framing.box;
    const share = (part) => `${(100 * part).toFixed(1)}%`;
    // The picture is mirrored, as a mirror is.
    Object.assign(this.box.style, { left: share(1 - left - width), top: share(top), width: share(width), height: share(height) });
    const good = framing.face === "one" && !framing.advice;
    this.view.dataset.state = good ? "good" : "bad";
    this.#say(good ? "That is good. Hold still." : framing.advice || FACES[framing.face] || "");
  }

  #say(words) {
    if (this.advice.textContent !== words) this.advice.textContent = words;
  }
}
