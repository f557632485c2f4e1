// Whether others than the subject may move the portrait: offered where somebody else is before the camera.

import { attempt } from "../api.js";
import { on } from "../stage/events.js";
import { accept, onScene, scene } from "../stage/scene.js";
import { ask, make, setText } from "../widgets.js";

const CONSENT = "Others will see this person’s face, moved by whoever sits at the camera: do so only with that person’s consent. It counts for this face alone; after a restart it is asked again.";

const part = document.getElementById("avatar");
const words = make("strong");
const button = make("button", { type: "button", id: "avatar-allow" });
part.append(words, " ", button);
let other = false;

async function allow(allowed) {
  const body = await attempt("PATCH", "scene", { avatar_allowed: allowed });
  if (body) accept(body);
}

async function askAvatar() {
  const { subject } = scene();
  const yes = await ask(`Let others move “${subject}”?`, "Let others move it", null, CONSENT);
  if (yes && scene()?.subject === subject) await allow(true);
}

function draw() {
  const now = scene();
  if (!now) return;
  const { avatar_allowed: allowed, mode, subject } = now;
  part.hidden = !allowed && !(other && subject && mode === "portrait");
  setText(words, allowed ? `Anybody may move the portrait of “${subject}”.` : "");
  setText(button, allowed ? "Stop that" : "Let others move this portrait…");
}

button.onclick = () => (scene()?.avatar_allowed ? allow(false) : askAvatar());
on("status", ({ degraded }) => {
  other = degraded.some(({ code }) => code === "other-person");
  draw();
});
onScene(draw);
