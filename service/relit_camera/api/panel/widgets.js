// Small controls: sliders, groups of buttons, lists, tiles, the dialog.

import { loadPicture } from "./pictures.js";

const HELD_MS = 500;
const NAME_PATTERN = "[A-Za-z0-9]([A-Za-z0-9 ._\\-]*[A-Za-z0-9_\\-])? *";
const NAME_RULE = "Letters, digits, spaces, dots, dashes and underscores; a letter or digit first";

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
  for (const button of group.querySelectorAll("button")) setAttribute(button, "aria-pressed", button.value === value);
}

/**
 * Keeps the children of `parent` in step with `items`, each in its own element: no element is replaced or moved without
 * need, so that a click that has begun on it also ends on it.
 * key(item) names an item; create(item) answers {element, update(item)}.
 */
export function keyed(parent, items, key, create) {
  const kept = (parent.kept ??= new Map());
  const held = parent.contains(document.activeElement) ? document.activeElement : null;
  const wanted = new Set(items.map(key));
  let lost = -1;
  for (const [name, { element }] of kept) {
    if (wanted.has(name)) continue;
    if (element.contains(document.activeElement)) lost = [...parent.children].indexOf(element);
    element.remove();
    kept.delete(name);
  }
  items.forEach((item, index) => {
    const name = key(item);
    if (!kept.has(name)) kept.set(name, create(item));
    const { element, update } = kept.get(name);
    element.dataset.key = String(name);
    if (parent.children[index] !== element) parent.insertBefore(element, parent.children[index] ?? null);
    update?.(item);
  });
  if (lost >= 0) focusNear(parent, lost);
  else if (held && document.activeElement !== held) held.focus({ preventScroll: true }); // it was moved
}

/** Moves the keyboard to the item of a key, where `keyed` has one; nothing where `name` is null. */
export function focusItem(parent, name) {
  if (name !== null) parent.querySelector(`[data-key="${CSS.escape(name)}"] button`)?.focus();
}

/** Moves the keyboard from what was removed to its neighbour; where none is left, to the section's heading. */
function focusNear(parent, index) {
  const neighbour = parent.children[Math.min(index, parent.children.length - 1)];
  const heading = parent.closest("section")?.querySelector("h2");
  if (heading) heading.tabIndex = -1;
  (neighbour?.querySelector("button") ?? neighbour ?? heading)?.focus();
}

/** Sets an attribute only where it differs, so that nothing is drawn or read aloud again. */
export function setAttribute(element, name, value) {
  if (element.getAttribute(name) !== String(value)) element.setAttribute(name, String(value));
}

/** Makes a button do nothing, or something again. Unlike `disabled` this leaves it the focus; its click asks for itself. */
export function setEnabled(button, enabled) {
  if (enabled) button.removeAttribute("aria-disabled");
  else setAttribute(button, "aria-disabled", true);
}

/** Sets the text only where it differs. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Fills a select with [value, text] pairs, unless it has them already. */
export function setOptions(select, pairs, chosen) {
  const stands = JSON.stringify(pairs);
  if (select.dataset.pairs !== stands) {
    select.dataset.pairs = stands;
    select.replaceChildren(...pairs.map(([value, text]) => make("option", { value }, text)));
  }
  if (select.value !== chosen) select.value = chosen;
}

/**
 * A tile with a picture (or a symbol), a name, and, where it may be deleted, a button for that, or a menu: its elements.
 * Answers {element, image, update({chosen})}.
 */
export function tile({ name, title = name, picture, symbol, onChoose, onDelete, menu = [] }) {
  const image = make("img", { alt: "" });
  const face = picture ? make("span", { className: "face" }, image) : make("span", { className: "symbol", "aria-hidden": "true" }, symbol);
  const button = make("button", { type: "button", "aria-pressed": "false", title }, face, make("span", { className: "name" }, name));
  button.onclick = onChoose;
  if (picture) loadPicture(image, picture);
  const element = make("div", { className: "tile" }, button, ...menu);
  if (onDelete) {
    const remove = make("button", { type: "button", className: "close", "aria-label": `Delete ${name}` }, "×");
    remove.onclick = onDelete;
    element.append(remove);
  }
  return {
    element,
    image,
    update: ({ chosen }) => setAttribute(button, "aria-pressed", chosen),
  };
}

/**
 * Asks for a name, or, with `text` null, for consent. Answers the name (or true), or null when cancelled.
 * `words` is a sentence below the title that says what it means.
 */
export function ask(title, action, text = null, words = "") {
  const dialog = document.getElementById("ask");
  const input = document.getElementById("ask-text");
  const ok = document.getElementById("ask-ok");
  const explained = document.getElementById("ask-words");
  document.getElementById("ask-title").textContent = title;
  ok.textContent = action;
  explained.textContent = words;
  explained.hidden = !words;
  input.hidden = text === null;
  input.required = text !== null;
  input.pattern = text === null ? ".*" : NAME_PATTERN;
  input.title = NAME_RULE;
  input.value = text ?? "";
  return new Promise((answer) => {
    let given = null;
    // A form, so that Enter submits: a key that closed the dialog itself would then press what has the focus behind it.
    document.getElementById("ask-form").onsubmit = (event) => {
      event.preventDefault();
      given = text === null ? true : input.value.trim() || null;
      dialog.close();
    };
    document.getElementById("ask-cancel").onclick = () => dialog.close();
    dialog.onclose = () => answer(given);
    dialog.showModal();
    (text === null ? document.getElementById("ask-cancel") : input).focus();
    input.select();
  });
}

/** A file's name made into one that the camera takes: letters, digits, space, dot, dash, underscore. */
export function storedName(fileName) {
  const stem = fileName.replace(/\.[^.]*$/, "");
  const plain = stem.normalize("NFKD").replace(/[^A-Za-z0-9 _.-]+/g, "").replace(/^[^A-Za-z0-9]+/, "");
  return plain.slice(0, 64).trim() || "picture";
}
