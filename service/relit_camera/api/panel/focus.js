// The keyboard's place: where what has the focus goes away, the focus goes to what it stood in, never to nowhere.

/** Follows the focus, and moves it where its element is removed, hidden or disabled. */
export function keepFocus() {
  let last = null;
  let around = [];
  document.addEventListener("focusin", ({ target }) => {
    last = target;
    around = [];
    for (let each = target.parentElement; each && each !== document.body; each = each.parentElement) around.push(each);
  });
  // A press on the page's ground takes the focus away on purpose.
  document.addEventListener("pointerdown", () => { last = null; }, true);
  const look = () => {
    const now = document.activeElement;
    if (!last || (now !== document.body && now !== last)) return;
    if (isThere(last) && !last.disabled) return;
    const place = around.find((each) => each.matches("section, header, dialog, aside, main") && isThere(each));
    const next = [...(place?.querySelectorAll("h1, h2") ?? [])].find(isThere) ?? place ?? document.querySelector("main");
    if (next.tabIndex < 0) next.tabIndex = -1;
    next.focus({ preventScroll: true });
  };
  new MutationObserver(look).observe(document.body, { subtree: true, childList: true, attributes: true, attributeFilter: ["hidden", "disabled"] });
}

function isThere(element) {
  return element.isConnected && element.checkVisibility({ visibilityProperty: true });
}
