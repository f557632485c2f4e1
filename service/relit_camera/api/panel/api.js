// Requests to the camera, and what to say when one fails.

const BASE = "/api/v1/";
const TOAST_MS = 8000;
const SPACING_MS = 40;

/** Asks the camera; answers the JSON body, or null for none. A refusal is shown as a toast and thrown. */
export async function request(method, path, body) {
  const form = body instanceof FormData;
  const options = { method };
  if (body !== undefined) {
    options.body = form ? body : JSON.stringify(body);
    if (!form) options.headers = { "Content-Type": "application/json" };
  }
  let answer;
  try {
    answer = await fetch(BASE + path, options);
  } catch (error) {
    toast("The camera does not answer", "Is it still running?");
    throw error;
  }
  if (answer.status === 401) location.assign("/login"); // the camera began anew, or has another token
  const text = await answer.text();
  const json = text ? JSON.parse(text) : null;
  if (!answer.ok) {
    toast(json?.what ?? answer.statusText, json?.cure ?? "");
    throw new Error(json?.detail ?? answer.statusText);
  }
  return json;
}

/** Like `request`, for buttons: the toast has said what went wrong, nothing more is to be done. */
export function attempt(method, path, body) {
  return request(method, path, body).catch(() => null);
}

/** Shows what is wrong and what cures it, for a while. The same words are not shown twice. */
export function toast(what, cure = "") {
  const area = document.getElementById("toasts");
  const words = `${what}|${cure}`;
  [...area.children].find((shown) => shown.dataset.words === words)?.remove();
  const box = document.createElement("div");
  box.className = "toast";
  box.dataset.words = words;
  const title = document.createElement("strong");
  title.textContent = sentence(what);
  box.append(title);
  if (cure) {
    const advice = document.createElement("span");
    advice.textContent = sentence(cure);
    box.append(advice);
  }
  const close = document.createElement("button");
  close.type = "button";
  close.className = "close";
  close.setAttribute("aria-label", "Dismiss");
  close.textContent = "×";
  close.onclick = () => box.remove();
  box.append(close);
  area.append(box);
  setTimeout(() => box.remove(), TOAST_MS);
}

export function sentence(text) {
  const capital = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?…]$/.test(capital) ? capital : `${capital}.`;
}

const merged = (before, change) => ({ ...before, ...change });

/**
 * Sends changes one at a time. What is pushed meanwhile is joined into one, so that the latest wins and none queues up.
 * `settled()` is called when all is sent.
 */
export class Latest {
  #pending = null;
  #busy = false;

  constructor(send, { join = merged, settled = () => {} } = {}) {
    this.send = send;
    this.join = join;
    this.settled = settled;
  }

  push(change) {
    this.#pending = this.#pending ? this.join(this.#pending, change) : change;
    if (!this.#busy) this.#drain();
  }

  get idle() {
    return !this.#busy;
  }

  async #drain() {
    this.#busy = true;
    while (this.#pending) {
      const change = this.#pending;
      this.#pending = null;
      await this.send(change).catch(() => null);
      await new Promise((done) => setTimeout(done, SPACING_MS));
    }
    this.#busy = false;
    this.settled();
  }
}
