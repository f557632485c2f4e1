// Places as tiles, drawn with one's own face where there is a subject. A place is also what is behind one, unless another
// background is to be kept.

import { KEY_LIGHT } from "../light/lamps.js";
import { UNTURNED, standingLook } from "../light/looks.js";
import { forgetWaiting, loadPicture } from "../pictures.js";
import { ANYONE, change, onScene, scene } from "../stage/scene.js";
import { on } from "../stage/events.js";
import { keyed, tile } from "../widgets.js";
import { backgroundToMatch, keepsBackground } from "./background.js";
import { onStored, remove, stored, uploads } from "./stored.js";

const strip = document.getElementById("environments");

/** Lights the person by a place, and puts it behind them. */
function choose(name) {
  const now = scene();
  if (!now) return;
  const behind = keepsBackground() ? {} : { background: now.background.kind === "environment" ? now.background : { kind: "environment" } };
  // Lamps that came with a look go with it; lamps of one's own stay.
  const light = standingLook(now)?.lighting.lamps.length ? { ...UNTURNED, lamps: [] } : {};
  change({ lighting: { ...light, environment: name }, ...behind });
}

function chooseBackgroundLight() {
  const now = scene();
  if (now) change({ lighting: { environment: "background" }, background: backgroundToMatch(now) });
}

/** No place; and a key light where no lamp would light the person. */
function chooseLampsOnly() {
  const now = scene();
  if (!now) return;
  const lit = now.lighting.lamps.some((lamp) => !lamp.muted && lamp.intensity > 0);
  const lamps = lit ? {} : { lamps: [...now.lighting.lamps, { ...KEY_LIGHT, name: "Key" }] };
  change({ lighting: { environment: null, ...lamps } });
}

function items(chosen) {
  const places = stored("environments").map((item) => ({
    key: `place ${item.name}`,
    value: item.name,
    name: item.builtin ? item.name.replaceAll("-", " ") : item.name,
    picture: item.thumbnail,
    onChoose: () => choose(item.name),
    onDelete: item.builtin || item.temporary ? null : () => remove("environments", item.name),
  }));
  const all = [
    ...places,
    { key: "background", value: "background", name: "Background", title: "Lit by the picture behind you", symbol: "▣", onChoose: chooseBackgroundLight },
    { key: "lamps", value: null, name: "Lamps only", title: "No place: only lamps light you", symbol: "✦", onChoose: chooseLampsOnly },
  ];
  return all.map((item) => ({ ...item, chosen: item.value === chosen }));
}

function draw() {
  keyed(strip, items(scene()?.lighting.environment), ({ key }) => key, (item) => {
    const made = tile(item);
    if (item.picture) faces.set(item.value, made.image);
    return made;
  });
}

// One's own face in each place

const faces = new Map();
let subject = null;
let version = 0;

function drawFaces() {
  version += 1;
  forgetWaiting("made");
  for (const { name, thumbnail } of stored("environments")) {
    const face = faces.get(name);
    const onMe = `/api/v1/environments/${encodeURIComponent(name)}/on-me.jpg?of=${encodeURIComponent(subject)}&version=${version}`;
    // Where there is none, the place itself stays.
    if (face && subject) loadPicture(face, onMe, "made");
    else if (face) loadPicture(face, thumbnail);
  }
}

onScene((now) => {
  draw();
  const own = now.subject === ANYONE ? null : now.subject;
  if (own === subject) return;
  subject = own;
  drawFaces();
});
onStored((collection) => {
  if (collection !== "environments") return;
  draw();
  drawFaces();
});
on("collection", ({ name }) => name === "subjects" && drawFaces()); // perhaps captured anew under the same name
uploads(document.getElementById("environment-file"), "environments", choose);
