// What is stored: environments, backgrounds, subjects, presets, kept in step with the camera; and adding to it.

import { attempt, request, toast } from "../api.js";
import { on } from "../stage/events.js";
import { ask, storedName } from "../widgets.js";

const MOST_BYTES = 64 * 1024 * 1024;

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

/** Lets a file input add to a collection; `then(name)` is called when it is stored. */
export function uploads(input, collection, then) {
  input.onchange = async () => {
    const [file] = input.files;
    if (!file) return;
    const name = storedName(file.name);
    const taken = await upload(collection, file, name);
    input.value = "";
    if (taken) then(name);
  };
}

async function upload(collection, file, name) {
  if (file.size > MOST_BYTES) {
    toast(`${file.name} has ${Math.round(file.size / 1e6)} MB`, "The largest that is taken has 67 MB; scale it down");
    return false;
  }
  const form = new FormData();
  form.append("name", name);
  form.append("file", file);
  try {
    await request("POST", collection, form);
  } catch {
    return false; // the toast has said why
  }
  await load(collection);
  return true;
}

on("collection", ({ name }) => name in items && load(name));
