// Presets: looks stored under a name, with the person; one of them may be shown at each start.

import { attempt } from "../api.js";
import { ask, focusItem, keyed, make, setText } from "../widgets.js";
import { menuButton, menuEntry } from "./menu.js";
import { load, onStored, remove, rename, stored } from "./stored.js";

const list = document.getElementById("presets");
const path = (name) => `presets/${encodeURIComponent(name)}`;

async function save() {
  const name = await ask("Name of the preset", "Save", "");
  if (!name) return;
  if (stored("presets").some((item) => item.name === name)) return replace(name);
  await attempt("PUT", path(name));
  await load("presets");
}

async function patch(name, change) {
  await attempt("PATCH", path(name), change);
  await load("presets");
}

async function replace(name) {
  if (!(await ask(`Replace “${name}”?`, "Replace", null, "What it kept is lost."))) return;
  await attempt("PUT", path(name));
  await load("presets");
}

function chip({ name }) {
  const button = make("button", { type: "button", title: `Show ${name}` }, name);
  button.onclick = () => attempt("POST", `${path(name)}/apply`);
  let isAtStart = false;
  const start = menuEntry("Show at start", () => patch(name, { at_start: !isAtStart }));
  const menu = menuButton(`Options of ${name}`,
    menuEntry("Rename", async () => focusItem(list, await rename("presets", name))),
    start,
    menuEntry("Replace with this look", () => replace(name)),
    menuEntry("Delete", () => remove("presets", name)));
  const mark = make("span", { className: "mark", hidden: true }, "at start");
  return {
    element: make("li", {}, button, mark, ...menu),
    update: (item) => {
      isAtStart = Boolean(item.at_start);
      mark.hidden = !isAtStart;
      setText(start, isAtStart ? "No longer at start" : "Show at start");
    },
  };
}

document.getElementById("preset-save").onclick = save;
onStored((collection) => {
  if (collection !== "presets") return;
  keyed(list, stored("presets"), ({ name }) => name, chip);
  document.getElementById("presets-none").hidden = stored("presets").length > 0;
});
