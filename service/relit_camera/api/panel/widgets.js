// Small controls: sliders, groups of buttons, tiles, the dialog.

const HELD_MS = 500;

/** Makes an element: `make("p", {className: "hint"}, "text", child)`. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("aria-") || name === "role") element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children);
  return element;
}

export function degrees(value) {
  return `${signed(value, 0)}°`;
}

export function stops(value) {
  return `${signed(value, 1)} EV`;
}

export function percent(value) {
  return `${Math.round(value * 100)} %`;
}

export function signed(value, digits) {
  const shown = Math.abs(value).toFixed(digits);
  if (Number(shown) === 0) return shown;
  return (value < 0 ? "−" : "+") + shown;
}

let ids = 0;

/**
 * A labelled slider whose value is a button that resets it.
 * spec: label, min, max, step, initial, show(value); onInput(value) on every move.
 * While a person moves it, `set` waits: another panel's change must not pull it out of their hand.
 */
export function slider(spec, onInput) {
  const id = `slider-${++ids}`;
  const input = make("input", { type: "range", id, min: spec.min, max: spec.max, step: spec.step, value: spec.initial });
  if (spec.className) input.className = spec.className;
  const reset = `Reset ${spec.label.toLowerCase()} to ${spec.show(spec.initial)}`;
  const value = make("button", { type: "button", className: "value", title: reset, "aria-label": reset });
  const element = make("div", { className: "row" }, make("label", { htmlFor: id }, spec.label), input, value);
  let heldUntil = 0;
  let wanted = spec.initial;

  function draw(number) {
    value.textContent = spec.show(number);
    input.setAttribute("aria-valuetext", spec.show(number));
    const share = (input.value - spec.min) / (spec.max - spec.min);
    const origin = spec.min < 0 ? -spec.min / (spec.max - spec.min) : 0;
    input.style.setProperty("--from", `${100 * Math.min(share, origin)}%`);
    input.style.setProperty("--to", `${100 * Math.max(share, origin)}%`);
  }

  function show() {
    if (performance.now() < heldUntil) {
      setTimeout(show, heldUntil - performance.now() + 5);
      return;
    }
    input.value = wanted;
    draw(wanted);
  }

  function move(number) {
    heldUntil = performance.now() + HELD_MS;
    wanted = number;
    draw(number);
    onInput(number);
  }

  input.oninput = () => move(Number(input.value));
  value.onclick = () => {
    input.value = spec.initial;
    move(spec.initial);
  };
  draw(spec.initial);
  return {
    element,
    set(number) {
      wanted = number;
      show();
    },
  };
}

/** Marks the button with this value as the chosen one. */
export function choose(group, value) {
  for (const button of group.querySelectorAll("button")) {
    button.setAttribute("aria-pressed", String(button.value === value));
  }
}

/** A tile with a picture (or a symbol), a name, and, where it may be deleted, a button for that. */
export function tile({ name, title = name, picture, symbol, chosen, onChoose, onDelete }) {
  const face = picture
    ? make("img", { src: picture, alt: "", width: 256, height: 128, loading: "lazy" })
    : make("span", { className: "symbol", "aria-hidden": "true" }, symbol);
  const button = make("button", { type: "button", "aria-pressed": String(chosen), title }, face, make("span", { className: "name" }, name));
  button.onclick = onChoose;
  const element = make("div", { className: "tile" }, button);
  if (onDelete) {
    const remove = make("button", { type: "button", className: "close", "aria-label": `Delete ${name}` }, "×");
    remove.onclick = onDelete;
    element.append(remove);
  }
  return element;
}

/** Asks for a word, or, with `text` null, for consent. Answers the word (or true), or null when cancelled. */
export function ask(title, action, text = null) {
  const dialog = document.getElementById("ask");
  const input = document.getElementById("ask-text");
  const ok = document.getElementById("ask-ok");
  document.getElementById("ask-title").textContent = title;
  ok.textContent = action;
  input.hidden = text === null;
  input.value = text ?? "";
  return new Promise((answer) => {
    let given = null;
    const accept = () => {
      given = text === null ? true : input.value.trim() || null;
      dialog.close();
    };
    ok.onclick = accept;
    input.onkeydown = (event) => {
      if (event.key === "Enter") accept();
    };
    document.getElementById("ask-cancel").onclick = () => dialog.close();
    dialog.onclose = () => answer(given);
    dialog.showModal();
    (text === null ? ok : input).focus();
    input.select();
  });
}

/** A file's name made into one that the camera takes: letters, digits, space, dot, dash, underscore. */
export function storedName(fileName) {
  const stem = fileName.replace(/\.[^.]*$/, "");
  const plain = stem.normalize("NFKD").replace(/[^A-Za-z0-9 _.-]+/g, "").replace(/^[^A-Za-z0-9]+/, "");
  return plain.slice(0, 64).trim() || "picture";
}
