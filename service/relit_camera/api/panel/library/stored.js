// What is stored: environments, backgrounds, subjects, presets, kept in step with the camera; and adding to it.

import { attempt, toast } from "../api.js";
import { upload } from "../capture/upload.js";
import { on } from "../stage/events.js";
import { ask, setAttribute, setEnabled, storedName } from "../widgets.js";
import { checkFile } from "./limits.js";

const MOST_TRIES = 9;

const items = { environments: [], backgrounds: [], subjects: [], presets: [] };
const listeners = [];

/** The items of a collection, as the camera last told them. */
export function stored(collection) {
  return items[collection];
}

/** Calls `callback(name of the collection)` when a collection was loaded. */
export function onStored(callback) {
  listeners.push(callback);
}

export async function load(collection) {
  const found = await attempt("GET", collection);
  if (!found) return;
  items[collection] = found;
  for (const callback of listeners) callback(collection);
}

export function loadAll() {
  Object.keys(items).forEach(load);
}

export async function remove(collection, name) {
  if (await ask(`Delete “${name}”?`, "Delete", null, "This cannot be undone.")) {
    await attempt("DELETE", `${collection}/${encodeURIComponent(name)}`);
  }
}

/** Asks for another name of what is stored; answers it, or null where it keeps its own. */
export async function rename(collection, name) {
  const other = await ask(`New name of “${name}”`, "Rename", name);
  if (!other || other === name) return null;
  if (!(await attempt("PATCH", `${collection}/${encodeURIComponent(name)}`, { name: other }))) return null;
  await load(collection);
  return other;
}

/**
 * Stores a file under its own name or, where that is taken, with a number: "Studio 2". Answers the name.
 * `onProgress(share)` hears how much of it is sent, 0 to 1. Throws `Refused`.
 */
export async function store(collection, file, onProgress) {
  checkFile(file, collection);
  const base = storedName(file.name).slice(0, 60);
  const taken = new Set(stored(collection).map((item) => item.name));
  for (let number = 1, tries = 1; ; number++) {
    const name = number === 1 ? base : `${base} ${number}`;
    if (taken.has(name)) continue;
    const form = new FormData();
    form.append("name", name);
    form.append("file", file); // the last one: a large file is written as it comes
    try {
      await upload(collection, form, onProgress);
    } catch (error) {
      // Somebody else has just stored one of that name.
      if (error.status === 409 && tries++ < MOST_TRIES) continue;
      throw error;
    }
    await load(collection);
    return name;
  }
}

/** Lets a file input, in its label, add to a collection; `then(name)` is called when it is stored. */
export function uploads(input, collection, then) {
  const label = input.closest("label");
  const words = label.firstChild.textContent;
  const show = (text, busy) => {
    label.firstChild.textContent = text;
    setAttribute(label, "aria-busy", busy);
    setEnabled(input, !busy);
  };
  input.onclick = (event) => {
    if (label.ariaBusy === "true") event.preventDefault();
  };
  input.onchange = async () => {
    const [file] = input.files;
    input.value = "";
    if (!file || label.ariaBusy === "true") return;
    show("Uploading…", true);
    try {
      then(await store(collection, file, (share) => show(share < 1 ? `Uploading… ${Math.round(100 * share)} %` : "Storing…", true)));
    } catch (error) {
      toast(error.what, error.cure);
    }
    show(words, false);
  };
}

on("collection", ({ name }) => name in items && load(name));
