// What is behind the person: its kind, the few options of each kind, and whether a place may replace it.

import { change, onScene, scene } from "../stage/scene.js";
import { choose, degrees, keyed, make, percent, setAttribute, slider, tile } from "../widgets.js";
import { onStored, remove, stored, uploads } from "./stored.js";

const STRENGTH = { label: "Strength", min: 0.05, max: 1, step: 0.05, initial: 0.5, show: percent };
const HEIGHT = { label: "View angle", min: 10, max: 120, step: 1, initial: 35, show: (value) => degrees(value).replace("+", "") };
const BLUR = { label: "Blur", min: 0, max: 1, step: 0.05, initial: 0.15, show: percent };
const DEFAULT_COLOR = "#202428";
const FALLBACK_PLACE = "studio";
const KEEP = "keep-background";
const NONE_HINTS = { live: "Your own room, as the webcam sees it.", portrait: "A dark neutral." };

const kinds = document.getElementById("background-kind");
const options = document.getElementById("background-options");
const keep = document.getElementById("keep-background");
let drawn = "";
let set = () => {};
let place = FALLBACK_PLACE;
let keeping = remembered();

/** Whether the background stays when another place is chosen. */
export function keepsBackground() {
  return keeping;
}

/** What was chosen in this browser before; nothing where it stores nothing. */
function remembered() {
  try {
    return localStorage.getItem(KEEP) === "yes";
  } catch {
    return false;
  }
}

/** A background whose light can fall on the person: the present one, else a picture. */
export function backgroundToMatch(now) {
  if (["image", "color"].includes(now.background.kind)) return now.background;
  const [own] = stored("backgrounds");
  return { kind: "image", image: own?.name ?? place };
}

/** Another background; a light that came from the old one comes from the last place where the new one has no picture. */
function put(background) {
  const dark = scene()?.lighting.environment === "background" && !["image", "color"].includes(background.kind);
  change({ background, ...(dark && { lighting: { environment: place } }) });
}

function setKeeping(on) {
  keeping = on;
  try {
    localStorage.setItem(KEEP, on ? "yes" : "no");
  } catch {
    // Kept until the page is closed.
  }
  setAttribute(keep, "aria-pressed", keepsBackground());
}

keep.onclick = () => setKeeping(!keepsBackground());
kinds.onclick = (event) => {
  const kind = event.target.closest("button")?.value;
  if (!kind || kind === scene()?.background.kind) return;
  setKeeping(kind !== "environment");
  const [first] = stored("backgrounds");
  if (kind === "image") put({ kind, image: first?.name ?? place });
  else put(kind === "color" ? { kind, color: DEFAULT_COLOR } : { kind });
};
uploads(document.getElementById("background-file"), "backgrounds", (name) => {
  setKeeping(true);
  put({ kind: "image", image: name });
});

function pictureTiles(chosen) {
  const item = (own) => ({ name, thumbnail }) => ({ name, thumbnail, own, chosen: name === chosen });
  const pictures = [...stored("backgrounds").map(item(true)), ...stored("environments").filter(({ temporary }) => !temporary).map(item(false))];
  keyed(options.firstChild, pictures, ({ name, own: mine }) => `${mine} ${name}`, ({ name, thumbnail, own: mine }) => {
    const choosePicture = () => {
      setKeeping(true);
      put({ kind: "image", image: name });
    };
    return tile({ name, picture: thumbnail, onChoose: choosePicture, onDelete: mine ? () => remove("backgrounds", name) : null });
  });
}

/** Makes the controls of a kind; answers what keeps them in step. */
function controlsOf(kind) {
  const part = (spec, field) => slider(spec, (value) => put({ ...scene().background, [field]: value }));
  if (kind === "blur") {
    const strength = part(STRENGTH, "strength");
    options.replaceChildren(strength.element);
    return ({ background }) => strength.set(background.strength);
  }
  if (kind === "environment") {
    const height = part(HEIGHT, "height_deg");
    const blur = part(BLUR, "blur");
    options.replaceChildren(height.element, blur.element);
    return ({ background }) => {
      height.set(background.height_deg ?? HEIGHT.initial);
      blur.set(background.blur ?? BLUR.initial);
    };
  }
  if (kind === "color") {
    const input = make("input", { type: "color", id: "background-color" });
    input.oninput = () => put({ kind: "color", color: input.value });
    options.replaceChildren(make("div", { className: "row" }, make("label", { htmlFor: input.id }, "Colour"), input));
    return ({ background }) => {
      if (document.activeElement !== input) input.value = background.color.toLowerCase();
    };
  }
  if (kind === "image") {
    options.replaceChildren(make("div", { className: "tiles" }));
    return ({ background }) => pictureTiles(background.image);
  }
  const hint = make("p", { className: "hint" });
  options.replaceChildren(hint);
  return ({ mode }) => { hint.textContent = NONE_HINTS[mode]; };
}

function show(now) {
  const { environment } = now.lighting;
  // Not one from the command line: it lights, but there is no picture of it to be put behind the person.
  if (stored("environments").some(({ name, temporary }) => name === environment && !temporary)) place = environment;
  choose(kinds, now.background.kind);
  setAttribute(keep, "aria-pressed", keepsBackground());
  document.getElementById("background-upload").hidden = now.background.kind !== "image";
  if (now.background.kind !== drawn) {
    drawn = now.background.kind;
    set = controlsOf(drawn);
  }
  set(now);
}

onScene(show);
onStored(() => scene() && show(scene()));
