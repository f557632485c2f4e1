// The ladder: how the present subject was captured, what may be trusted, in the present light too, the next rung, and
// its expression stills.

import { call, toast } from "../api.js";
import { on } from "../stage/events.js";
import { ANYONE, onScene, scene, showsNobody } from "../stage/scene.js";
import { make, setText } from "../widgets.js";
import { captureFace, openDoors } from "./doors.js";

const DEMO_NAME = "demo person";
const MOSTLY = 0.6; // of a known man all places beyond it were worse than 23 dB before a screen (docs/desk.md)
const RUNGS = {
  instant: {
    line: "captured in the light of a room",
    trust: "Right in soft places: a room, a sky, a sunset. Lamps from behind are softened.",
    next: ["Better: by this screen’s light, a minute", "/desk"],
  },
  desk: {
    line: "captured by the light of a screen",
    trust: "Light from the front is measured, from behind it is a guess.",
    next: ["Best: film yourself with a lamp, an evening", "/film"],
  },
  film: { line: "captured with a lamp and a mirror ball", trust: "Right in light from where the lamp was, a single hard lamp too." },
  pictures: { line: "captured under one light at a time", trust: "Right where there was light, modelled elsewhere." },
};
const OLD = { line: "captured by an older version, which did not note how", trust: "" };
const MEAN_HEAD = {
  line: "You are lit as an average head would be.",
  trust: "Nothing was captured of you. With a subject of your own, light and shadow fit your face, hair and clothes.",
  next: RUNGS.desk.next,
};
const DEMO = {
  line: "rendered, they do not exist",
  trust: "Right in any light. From ICT-FaceKit (MIT) and a head scan by Lee Perry-Smith (CC-BY 3.0).",
};

const ladder = document.getElementById("ladder");
const line = make("p", { id: "ladder-line", role: "status" });
const trust = make("p", { id: "ladder-trust", className: "hint" });
const light = make("p", { id: "ladder-light", className: "notes", role: "status", hidden: true });
const next = make("div", { className: "buttons" });
ladder.append(line, trust, light, next);

const stills = make("button", { type: "button", id: "ladder-stills", hidden: true });
stills.onclick = takeStills;

let named = null;
let known = "";

function show(now) {
  const name = showsNobody(now) ? null : now.subject;
  const key = `${name}|${now.rung}`;
  if (key === known) return;
  known = key;
  const rung = { [DEMO_NAME]: DEMO, [ANYONE]: MEAN_HEAD }[name] ?? RUNGS[now.rung] ?? OLD;
  if (rung === MEAN_HEAD) line.textContent = rung.line;
  else line.textContent = name === null ? "" : `“${name}”: ${rung.line}.`;
  trust.textContent = name === null ? "" : rung.trust;
  if (name !== named) stills.hidden = true; // else a button would vanish under somebody's hand
  named = name;
  if (name !== null && rung !== MEAN_HEAD) tellDetails(now, rung);
  const focused = ladder.contains(document.activeElement) ? document.activeElement.id : null;
  next.replaceChildren(...nextRungs(name, rung), stills, people());
  if (focused) document.getElementById(focused)?.focus();
}

/** The ways to the next rung: a page, or the capture of one's own face. */
function nextRungs(name, rung) {
  const page = rung.next ? [make("a", { id: "ladder-next", className: "button", href: rung.next[1] }, rung.next[0])] : [];
  if (name !== null && ![DEMO, OLD, MEAN_HEAD].includes(rung)) return page;
  const button = make("button", { type: "button", id: "ladder-face" }, rung === MEAN_HEAD ? "Make this my subject" : "My face now");
  button.onclick = captureFace;
  return [button, ...page];
}

/** Says, as the light changes, where most of it is a guess for this face, and that it is shown softer than it is. */
function tellLight({ light: trusted, subject: name }) {
  const guessed = trusted !== null && trusted.behind > MOSTLY && name === scene()?.subject;
  const told = ["Most of this light comes from behind: for this face that is a guess."];
  if (trusted?.softened > MOSTLY) told.push("It is shown softer than it is.");
  told.push("Turn the light to the front, or put a lamp before you.");
  setText(light, guessed ? told.join(" ") : "");
  light.hidden = !guessed;
}

function people() {
  const button = make("button", { type: "button", id: "ladder-people", className: "quiet" }, "Another face…");
  button.onclick = openDoors;
  return button;
}

/** Adds what the subject's file says of how much was measured, and the way to its expression stills. */
async function tellDetails({ subject: name, rung: kind }, rung) {
  const item = (await call("GET", "subjects").catch(() => [])).find((each) => each.name === name);
  if (!item) return;
  const details = await call("GET", `subjects/${encodeURIComponent(name)}`).catch(() => null);
  if (!details || !known.startsWith(`${name}|`)) return;
  const { measured_fraction: measured, expected_db: expected } = details.metadata;
  const told = [rung.trust];
  if (measured && kind !== "instant") told.push(`Measured from ${Math.round(100 * measured)} % of all directions.`);
  if (expected && kind !== "instant") told.push(`Expected quality ${Math.round(expected)} dB.`);
  if (details.stills) told.push(`${details.stills} pictures of your own mouth, eyes and cheeks.`);
  trust.textContent = told.join(" ");
  stills.textContent = details.stills ? "Your mouth, eyes and cheeks anew…" : "Next: your own mouth, eyes and cheeks, half a minute";
  stills.hidden = item.temporary || rung === DEMO; // others are not stored, or not you
}

async function takeStills() {
  const { subject } = scene();
  const dialog = await import("./stills.js").catch(() => null);
  if (!dialog) return toast("This part of the panel could not be loaded", "Try again; if it does not help, load the page again");
  await dialog.openStillsDialog(subject);
  if (document.activeElement === document.body && !stills.hidden) stills.focus();
}

onScene(show);
on("status", tellLight);
on("collection", ({ name }) => {
  if (name !== "subjects" || !scene()) return;
  known = ""; // perhaps its file has changed
  show(scene());
});
