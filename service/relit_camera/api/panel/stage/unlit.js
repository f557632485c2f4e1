// Being shown unlit, and back: who was seen before is remembered, so that one switch leads back to the same face.

import { call, request } from "../api.js";
import { accept, change, onScene, redraw, scene, settled } from "./scene.js";

const KEY = "seen-before-unlit";
let before = stored();
let coming = false;

/** Whether the face that was seen before is on its way back. */
export function comesBack() {
  return coming;
}

/** Publishes the webcam's own picture, which a person has confirmed. Throws `Refused`. */
export async function showUnlit() {
  const { subject, unlit_allowed: already } = scene();
  accept(await call("PATCH", "scene", { subject: null, unlit_allowed: true }));
  if (!already) remember(subject);
}

/** Ends that at once; then the face that was seen before is shown again. */
export async function hideUnlit() {
  const back = scene()?.subject ? null : before;
  coming = back !== null;
  try {
    // By itself, before what else is to be sent: nothing that cannot be shown may keep the webcam's picture published.
    const stop = ["PATCH", "scene", { unlit_allowed: false }];
    accept(await call(...stop).catch(() => request(...stop)));
    if (back) change({ subject: back });
    await settled();
  } catch {
    // The toast has said why the picture is still shown.
  } finally {
    coming = false;
    redraw();
  }
}

function remember(name) {
  before = name;
  try {
    if (name) sessionStorage.setItem(KEY, name);
    else sessionStorage.removeItem(KEY);
  } catch {
    // Kept until the page is closed.
  }
}

function stored() {
  try {
    return sessionStorage.getItem(KEY);
  } catch {
    return null;
  }
}

onScene((now) => {
  if (now.subject && before) remember(null);
});
