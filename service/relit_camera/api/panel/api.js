// Requests to the camera, and what to say when one fails.

const BASE = "/api/v1/";
const TOAST_MS = 8000;
const SPACING_MS = 40;

/** What the camera refused: `what` is wrong, its `cure`, and the HTTP `status`, 0 where nothing answered. */
export class Refused extends Error {
  constructor(what, cure = "", status = 0) {
    super(cure ? `${what}; ${cure}` : what);
    Object.assign(this, { what, cure, status });
  }
}

/** Asks the camera; answers the JSON body, or null for none. Throws `Refused`. */
export async function call(method, path, body) {
  const form = body instanceof FormData;
  const options = { method };
  if (body !== undefined) {
    options.body = form ? body : JSON.stringify(body);
    if (!form) options.headers = { "Content-Type": "application/json" };
  }
  let answer;
  try {
    answer = await fetch(BASE + path, options);
  } catch {
    throw new Refused("the camera does not answer", "is it still running?");
  }
  return understood(answer.status, await answer.text());
}

/** The JSON of an answer, or null for none. Throws `Refused` where it is an error. */
export function understood(status, text) {
  if (status === 401) location.assign("/login"); // the camera began anew, or has another token
  let json = null;
  try {
    json = JSON.parse(text);
  } catch {
    // An answer without a body, or of a proxy.
  }
  if (status >= 400) {
    const { what, cure } = forPeople(json);
    throw new Refused(what, cure, status);
  }
  return json;
}

/** Like `call`; a refusal is also shown as a toast. */
export async function request(method, path, body) {
  try {
    return await call(method, path, body);
  } catch (error) {
    toast(error.what, error.cure);
    throw error;
  }
}

/** What went wrong, without the advice that is meant for the authors of programs. */
function forPeople(problem) {
  if (!problem?.what || problem.type?.endsWith(":fault")) return { what: "The camera could not do that", cure: "Try again; the camera’s log says more" };
  const forPrograms = /\/api\/|\/healthz|\/readyz/.test(problem.cure ?? "");
  return { what: problem.what, cure: forPrograms ? "" : (problem.cure ?? "") };
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
 * The option `settled()` is called when all is sent; the method answers then.
 */
export class Latest {
  #pending = null;
  #drained = null;

  constructor(send, { join = merged, settled = () => {} } = {}) {
    this.send = send;
    this.join = join;
    this.onSettled = settled;
  }

  push(change) {
    this.#pending = this.#pending ? this.join(this.#pending, change) : change;
    this.#drained ??= this.#drain();
  }

  /** Answers when nothing is left to be sent. */
  async settled() {
    await this.#drained;
  }

  async #drain() {
    while (this.#pending) {
      const change = this.#pending;
      this.#pending = null;
      await this.send(change).catch(() => null);
      await new Promise((done) => setTimeout(done, SPACING_MS));
    }
    this.#drained = null;
    this.onSettled();
  }
}
