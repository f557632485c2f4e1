// One step of a page at a time: the others are hidden, the keyboard goes along, and the browser's Back leads back.

const $ = (id) => document.getElementById(id);

/** The sections `step-NAME` of a page, in their order; those of `counted` have a number. */
export class Steps {
  constructor(names, counted, onShow = () => {}) {
    Object.assign(this, { names, counted, onShow });
    this.current = "";
    addEventListener("popstate", (event) => this.#draw(event.state?.step ?? names[0]));
  }

  /** Shows a step. `replace` leaves no way back to the one before. */
  show(name, replace = false) {
    if (name === this.current) return;
    history[replace || !this.current ? "replaceState" : "pushState"]({ step: name }, "");
    this.#draw(name);
  }

  next() {
    this.show(this.names[this.names.indexOf(this.current) + 1]);
  }

  #draw(name) {
    const first = !this.current;
    this.current = name;
    for (const each of this.names) $(`step-${each}`).hidden = each !== name;
    const number = this.counted.indexOf(name) + 1;
    $("step-count").textContent = number ? `Step ${number} of ${this.counted.length}` : "";
    this.onShow(name);
    if (first) return;
    scrollTo(0, 0);
    $(`step-${name}`).querySelector("h2").focus();
  }
}

for (const button of document.querySelectorAll("[data-back]")) button.onclick = () => history.back();
