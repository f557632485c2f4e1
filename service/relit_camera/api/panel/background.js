// The background: its kind, and the few options of each kind.

import { Latest, request } from "./api.js";
import { choose, degrees, make, percent, slider } from "./widgets.js";

const STRENGTH = { label: "Strength", min: 0.05, max: 1, step: 0.05, initial: 0.5, show: percent };
const HEIGHT = { label: "View angle", min: 10, max: 120, step: 1, initial: 35, show: (value) => degrees(value).replace("+", "") };
const BLUR = { label: "Blur", min: 0, max: 1, step: 0.05, initial: 0.15, show: percent };

export class BackgroundControls {
  // Whole bodies, never joined: a field of one kind is none of another's.
  #queue = new Latest((body) => request("PUT", "background", body), { join: (_, body) => body });
  #drawn = "";
  #set = () => {};

  constructor() {
    this.kinds = document.getElementById("background-kind");
    this.options = document.getElementById("background-options");
    this.kinds.onclick = (event) => this.#chooseKind(event.target.closest("button")?.value);
  }

  /** The library of pictures, given after construction: each needs the other. */
  use(library) {
    this.collections = library;
  }

  /** Replace the background; the answer comes as the next `scene` event. */
  send(background) {
    this.#queue.push(background);
  }

  show(background) {
    this.current = background;
    const pictures = this.collections.stored.backgrounds.map((item) => item.name).join("|");
    const drawn = `${background.kind}|${background.kind === "image" ? `${background.image}|${pictures}` : ""}`;
    choose(this.kinds, background.kind);
    document.getElementById("background-upload").hidden = background.kind !== "image";
    if (drawn !== this.#drawn) {
      this.#drawn = drawn;
      this.#drawOptions(background);
    }
    this.#set(background);
  }

  #chooseKind(kind) {
    if (!kind || kind === this.current?.kind) return;
    if (kind !== "image") {
      this.send({ kind });
      return;
    }
    const [first] = this.collections.stored.backgrounds;
    if (first) {
      this.send({ kind, image: first.name });
      return;
    }
    // Nothing is stored yet: offer to add a picture, and leave the background as it is.
    this.#drawn = "";
    choose(this.kinds, "image");
    document.getElementById("background-upload").hidden = false;
    this.options.replaceChildren(make("p", { className: "hint" }, "No pictures are stored yet: add one."));
    this.#set = () => {};
  }

  #drawOptions(background) {
    const parts = (spec, field) => slider(spec, (value) => this.#queue.push({ ...this.current, [field]: value }));
    if (background.kind === "blur") {
      const strength = parts(STRENGTH, "strength");
      this.#fill([strength.element], (now) => strength.set(now.strength));
    } else if (background.kind === "environment") {
      const height = parts(HEIGHT, "height_deg");
      const blur = parts(BLUR, "blur");
      this.#fill([height.element, blur.element], (now) => {
        height.set(now.height_deg);
        blur.set(now.blur);
      });
    } else if (background.kind === "color") {
      const input = make("input", { type: "color", id: "background-color" });
      input.oninput = () => this.#queue.push({ kind: "color", color: input.value });
      const row = make("div", { className: "row" }, make("label", { htmlFor: input.id }, "Colour"), input);
      this.#fill([row], (now) => {
        if (document.activeElement !== input) input.value = now.color.toLowerCase();
      });
    } else if (background.kind === "image") {
      this.#fill([make("div", { className: "tiles small" }, ...this.collections.backgroundTiles(background.image))]);
    } else {
      this.#fill([make("p", { className: "hint" }, "A dark neutral in reenact mode, the live room in ratio mode.")]);
    }
  }

  #fill(elements, set = () => {}) {
    this.options.replaceChildren(...elements);
    this.#set = set;
  }
}
