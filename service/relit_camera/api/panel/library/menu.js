// A button with dots that opens a menu.

import { make } from "../widgets.js";

let menus = 0;

/** An entry of a menu: closes it, then does what it is for. */
export function menuEntry(text, act) {
  const element = make("button", { type: "button", role: "menuitem" }, text);
  element.onclick = () => {
    element.parentElement.hidePopover();
    act();
  };
  return element;
}

/** The button and its menu, which the arrow keys walk; both are to be put in the page. */
export function menuButton(label, ...entries) {
  const id = `menu-${++menus}`;
  const button = make("button", { type: "button", className: "close", "aria-label": label, "aria-haspopup": "menu" }, "⋯");
  button.setAttribute("popovertarget", id);
  const menu = make("div", { id, className: "menu", role: "menu", "aria-label": label }, ...entries);
  menu.setAttribute("popover", "auto");
  menu.addEventListener("toggle", (event) => {
    if (event.newState !== "open") return;
    const box = button.getBoundingClientRect();
    menu.style.setProperty("--left", `${Math.max(8, box.right - menu.offsetWidth)}px`);
    menu.style.setProperty("--top", `${Math.min(box.bottom + 4, window.innerHeight - menu.offsetHeight - 8)}px`);
    menu.firstChild.focus();
  });
  menu.onkeydown = (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    entries[(entries.indexOf(document.activeElement) + step + entries.length) % entries.length].focus();
  };
  return [button, menu];
}
