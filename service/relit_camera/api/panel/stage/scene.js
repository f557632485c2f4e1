// The scene as the page shows it: what the camera tells, with what was changed here and is on its way.

import { Latest, attempt, request } from "../api.js";
import { on } from "./events.js";

/** The subject that is whoever comes. */
export const ANYONE = "anyone";

const listeners = [];
let told = null;
let unsettled = null;

/** The scene, or null before the camera has told it. */
export function scene() {
  return told && unsettled ? joined(told, unsettled) : told;
}

/** Whether a scene shows nobody: whoever comes has no picture that could be moved. */
export function showsNobody({ subject, mode }) {
  return subject === null || (subject === ANYONE && mode === "portrait");
}

/** Calls `callback(scene)` now, if there is one, and after each change, whoever made it. */
export function onScene(callback) {
  listeners.push(callback);
  if (told) callback(scene());
}

/** Changes parts of the scene: lighting (any of its fields), background, mode, subject, frozen, unlit_allowed. */
export function change(parts) {
  unsettled = joined(unsettled ?? {}, parts);
  queue.push(parts);
  redraw();
}

/** A step back or forward, or everything as at the first start: "undo", "redo", "reset". Answers the scene, or null. */
export async function step(which) {
  await queue.settled();
  const body = await attempt("POST", `scene/${which}`);
  if (body) accept(body);
  return body;
}

/** Answers when everything that was changed here is sent. */
export function settled() {
  return queue.settled();
}

/** Shows what the camera has answered, without waiting for the event. */
export function accept(body) {
  if (!told || body.revision >= told.revision) told = body;
  redraw();
}

function joined(before, parts) {
  const lighting = parts.lighting ? { ...before.lighting, ...parts.lighting } : before.lighting;
  return { ...before, ...parts, ...(lighting && { lighting }) };
}

/** Tells the scene to all who follow it, once more. */
export function redraw() {
  const now = scene();
  if (now) for (const callback of listeners) callback(now);
}

const queue = new Latest(
  async (parts) => {
    const body = await request("PATCH", "scene", parts);
    if (!told || body.revision >= told.revision) told = body;
  },
  {
    join: joined,
    settled: () => {
      unsettled = null;
      redraw();
    },
  },
);

on("open", () => { told = null; }); // another run of the camera counts its revisions anew
on("scene", accept);
