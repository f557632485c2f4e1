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
  #running = false;
  #renewal = 0;
  #heard = 0;
  #query = "";

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
    document.addEventListener("visibilitychange", () => this.#look());
  }

  get running() {
    return this.#running;
  }

  /** Shows the webcam's picture and judges it, until `stop`, while the page is looked at. */
  start() {
    this.stop();
    this.showFilmed();
    this.advice.textContent = "Looking for your face…";
    this.#running = true;
    this.#look();
  }

  stop() {
    if (!this.#running) return;
    this.#running = false;
    this.#pause();
  }

  /** The picture as filmed, which nobody else sees. */
  showFilmed() {
    this.#open("before=true&mirror=true&width=640&fps=15");
  }

  /** The picture as others see it. */
  showRelit() {
    this.#open("mirror=true&width=640&fps=15");
  }

  close() {
    this.stop();
    this.#open("");
  }

  /** Shows the preview with this query, "" for none; nothing while the page is hidden, so that the webcam can rest. */
  #open(query) {
    this.#query = query;
    if (query && !document.hidden) this.picture.src = `/api/v1/preview.mjpg?${query}&opened=${Date.now()}`;
    else this.picture.removeAttribute("src");
  }

  /** Goes on while the page is looked at. */
  #look() {
    this.#open(this.#query);
    if (!this.#running) return;
    if (document.hidden) return this.#pause();
    clearInterval(this.#renewal);
    this.#heard = performance.now();
    this.#renewal = setInterval(() => this.#renew(), RENEW_MS);
    this.#renew();
  }

  #pause() {
    call("PUT", "framing", { wanted: false }).catch(() => null);
    clearInterval(this.#renewal);
    this.box.hidden = true;
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
    this.box.hidden = !framing.box || !this.picture.naturalWidth;
    if (!this.box.hidden) this.#place(framing.box);
    const good = framing.face === "one" && !framing.advice;
    this.view.dataset.state = good ? "good" : "bad";
    this.#say(good ? "That is good. Hold still." : framing.advice || FACES[framing.face] || "");
  }

  /** Puts the box round the face. The picture is mirrored, as a mirror is, and has bars beside it or above and below it. */
  #place([left, top, width, height]) {
    const { clientWidth, clientHeight, naturalWidth, naturalHeight } = this.picture;
    const scale = Math.min(clientWidth / naturalWidth, clientHeight / naturalHeight);
    const [wide, high] = [(scale * naturalWidth) / clientWidth, (scale * naturalHeight) / clientHeight]; // shares of the place
    const share = (part) => `${(100 * part).toFixed(1)}%`;
    Object.assign(this.box.style, {
      left: share((1 - wide) / 2 + wide * (1 - left - width)),
      top: share((1 - high) / 2 + high * top),
      width: share(wide * width),
      height: share(high * height),
    });
  }

  #say(words) {
    if (this.advice.textContent !== words) this.advice.textContent = words;
  }
}
