// Whose face is shown and how; faces are renamed and deleted here; and the switch to be seen as filmed.

import { attempt } from "../api.js";
import { askUnlit } from "../first/doors.js";
import { loadPicture } from "../pictures.js";
import { on } from "../stage/events.js";
import { ANYONE, change, onScene, scene, settled, showsNobody } from "../stage/scene.js";
import { hideUnlit } from "../stage/unlit.js";
import { ask, choose, focusItem, keyed, setAttribute, setText, tile } from "../widgets.js";
import { menuButton, menuEntry } from "./menu.js";
import { onStored, rename, stored } from "./stored.js";

const MODE_HINTS = {
  live: "Your live picture itself, relit: your own mouth and eyes.",
  portrait: "Your captured picture, relit, moves as you move: nothing of your room, or of today’s hair and clothes, is sent.",
};
const UNLIT_HINT = "The webcam’s picture is shown to others as it is.";
const NO_PORTRAIT_HINT = "Portrait moves a picture of you, and there is none yet: others see a still placeholder.";
const ANYONE_HINT = "Whoever sits here, lit as an average head would be.";
const HIDDEN_HINT = "Nobody is shown: others see a still placeholder.";

const list = document.getElementById("faces");
const allow = document.getElementById("unlit-allow");
const pictures = new Map();
let unlit = false;
let version = 0;

// Whoever is relit again is not to be shown as filmed later, when the face is lost.
const show = (name) => change({ subject: name, unlit_allowed: false });
const showAnyone = () => change({ subject: ANYONE, mode: "live", unlit_allowed: false });

async function remove(name) {
  const shown = scene()?.subject === name;
  const words = shown ? "This cannot be undone. Others see a placeholder until you choose another face." : "This cannot be undone.";
  if (!(await ask(`Delete “${name}”?`, "Delete", null, words))) return;
  if (shown) show(null);
  await settled(); // who is shown cannot be deleted
  await attempt("DELETE", `subjects/${encodeURIComponent(name)}`);
}

function face({ name, own, thumbnail }) {
  if (name === null) return tile({ name: "Nobody", title: HIDDEN_HINT, symbol: "∅", onChoose: () => show(null) });
  if (name === ANYONE) return tile({ name: "Anyone", title: ANYONE_HINT, symbol: "◐", onChoose: showAnyone });
  const menu = menuButton(`Options of ${name}`,
    menuEntry("Rename", async () => focusItem(list, await rename("subjects", name))),
    menuEntry("Delete", () => remove(name)));
  const made = tile({ name, picture: thumbnail, onChoose: () => show(name), menu: own ? menu : [] });
  pictures.set(name, made.image);
  return made;
}

function draw() {
  const now = scene();
  if (!now) return;
  const faces = stored("subjects").map(({ name, temporary, thumbnail }) => ({ name, own: !temporary, thumbnail }));
  const items = [...faces, { name: ANYONE }, { name: null }].map((item) => ({ ...item, chosen: item.name === now.subject && !now.unlit_allowed }));
  keyed(list, items, ({ name }) => name ?? "", face);
  choose(document.getElementById("mode"), now.mode);
  const hidden = now.subject === ANYONE ? NO_PORTRAIT_HINT : HIDDEN_HINT;
  const hint = showsNobody(now) ? hidden : MODE_HINTS[now.mode];
  setText(document.getElementById("mode-hint"), unlit ? UNLIT_HINT : hint);
  setAttribute(allow, "aria-pressed", now.unlit_allowed);
}

allow.onclick = () => (scene()?.unlit_allowed ? hideUnlit() : askUnlit());
document.getElementById("mode").onclick = (event) => {
  const mode = event.target.closest("button")?.value;
  if (mode) change({ mode });
};
document.getElementById("neutral").onclick = () => attempt("POST", "neutral-pose");
on("status", (status) => {
  if (unlit === Boolean(status.unlit)) return;
  unlit = Boolean(status.unlit);
  draw();
});
onScene(draw);
onStored((collection) => collection === "subjects" && draw());
on("collection", ({ name }) => {
  if (name !== "subjects") return;
  version += 1; // perhaps captured anew under the same name
  for (const { name: own, thumbnail } of stored("subjects")) {
    if (pictures.has(own)) loadPicture(pictures.get(own), `${thumbnail}?version=${version}`);
  }
});
