// Presets: looks stored under a name, with the person; one of them may be shown at each start.

import { attempt } from "../api.js";
import { ask, keyed, make, setText } from "../widgets.js";
import { load, onStored, remove, stored } from "./stored.js";

const path = (name) => `presets/${encodeURIComponent(name)}`;

async function save() {
  const name = await ask("Name of the preset", "Save", "");
  if (!name) return;
  const known = stored("presets").some((item) => item.name === name);
  if (known && !(await ask(`Replace “${name}”?`, "Replace", null, "The preset of that name is lost."))) return;
  await attempt("PUT", path(name));
  await load("presets");
}

async function rename(name) {
  const other = await ask(`New name of “${name}”`, "Rename", name);
  if (other && other !== name) await patch(name, { name: other });
}

async function patch(name, change) {
  await attempt("PATCH", path(name), change);
  await load("presets");
}

async function replace(name) {
  await attempt("PUT", path(name));
  await load("presets");
}

let menus = 0;

function chip({ name }) {
  const button = make("button", { type: "button", title: `Show ${name}` }, name);
  button.onclick = () => attempt("POST", `${path(name)}/apply`);
  const id = `preset-menu-${++menus}`;
  const more = make("button", { type: "button", className: "close", "aria-label": `Options of ${name}`, "aria-haspopup": "menu" }, "⋯");
  more.setAttribute("popovertarget", id);
  const entry = (text, act) => {
    const element = make("button", { type: "button", role: "menuitem" }, text);
    element.onclick = () => {
      menu.hidePopover();
      act();
    };
    return element;
  };
  let isAtStart = false;
  const start = entry("Show at start", () => patch(name, { at_start: !isAtStart }));
  const menu = make("div", { id, className: "menu", role: "menu", "aria-label": `Options of ${name}` },
    entry("Rename", () => rename(name)), start, entry("Replace with this look", () => replace(name)), entry("Delete", () => remove("presets", name)));
  menu.setAttribute("popover", "auto");
  menu.addEventListener("toggle", (event) => {
    if (event.newState !== "open") return;
    const box = more.getBoundingClientRect();
    menu.style.setProperty("--left", `${Math.max(8, box.right - menu.offsetWidth)}px`);
    menu.style.setProperty("--top", `${Math.min(box.bottom + 4, window.innerHeight - menu.offsetHeight - 8)}px`);
    menu.firstChild.focus();
  });
  menu.onkeydown = (event) => {
    const entries = [...menu.children];
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    entries[(entries.indexOf(document.activeElement) + step + entries.length) % entries.length].focus();
  };
  const mark = make("span", { className: "mark", hidden: true }, "at start");
  return {
    element: make("li", {}, button, mark, more, menu),
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
  keyed(document.getElementById("presets"), stored("presets"), ({ name }) => name, chip);
  document.getElementById("presets-none").hidden = stored("presets").length > 0;
});
