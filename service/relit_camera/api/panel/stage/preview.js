// The preview: the published picture while somebody looks, no larger than it is shown; and, held, the frame as filmed.

const FPS = 24;
const RETRY_MS = 1000;
const RESIZED_MS = 300;
const WIDTH_STEP = 160;
const MOST_DENSITY = 2;
const FIRST_WAIT_MS = 4000;

const image = document.getElementById("preview");
const screen = document.getElementById("screen");
const mirrorButton = document.getElementById("mirror");
const waiting = [];
let retry = 0;
let opened = "";
let resized = 0;

/** Whether the preview is shown as a mirror does. */
export function mirrored() {
  return mirrorButton.getAttribute("aria-pressed") === "true";
}

/** Calls `callback` when the preview is mirrored, or no longer. */
export function onMirror(callback) {
  mirrorButton.addEventListener("click", callback);
}

/** Answers when the first picture is there, or does not come soon: for what may wait until then. */
export function firstPicture() {
  if (image.naturalWidth) return Promise.resolve();
  return new Promise((done) => {
    waiting.push(done);
    setTimeout(done, FIRST_WAIT_MS);
  });
}

function variant() {
  const pixels = image.clientWidth * Math.min(window.devicePixelRatio, MOST_DENSITY);
  const width = Math.max(2 * WIDTH_STEP, Math.ceil(pixels / WIDTH_STEP) * WIDTH_STEP);
  return `mirror=${mirrored()}&width=${width}&fps=${FPS}`;
}

/** Opens the preview anew, in the size that it is shown in; closes it while the page is hidden. */
export function openPreview() {
  clearTimeout(retry);
  opened = document.hidden ? "" : variant();
  if (opened) image.src = `/api/v1/preview.mjpg?${opened}&opened=${Date.now()}`;
  else image.removeAttribute("src");
}

function fit() {
  clearTimeout(resized);
  resized = setTimeout(() => {
    if (opened && variant() !== opened) openPreview();
  }, RESIZED_MS);
}

/** Shows the frame as filmed in this page's preview only, or no longer. */
export function showBefore(held) {
  const before = document.getElementById("before-picture");
  const note = document.getElementById("before-note");
  if (held) {
    before.onload = () => { before.hidden = note.hidden = false; };
    before.src = `/api/v1/preview.mjpg?${variant()}&before=true&opened=${Date.now()}`;
  } else {
    before.onload = null;
    before.removeAttribute("src");
    before.hidden = note.hidden = true;
  }
}

image.addEventListener("load", () => {
  screen.style.setProperty("--aspect", `${image.naturalWidth / image.naturalHeight}`);
  waiting.splice(0).forEach((done) => done());
});
image.onerror = () => {
  waiting.splice(0).forEach((done) => done());
  // While nothing answers at all, the events find out when it does again.
  if (!document.body.classList.contains("lost")) retry = setTimeout(openPreview, RETRY_MS);
};
mirrorButton.addEventListener("click", () => {
  mirrorButton.setAttribute("aria-pressed", String(!mirrored()));
  document.body.classList.toggle("is-mirrored", mirrored());
  openPreview();
});
new ResizeObserver(fit).observe(image);
document.addEventListener("visibilitychange", openPreview);
addEventListener("pagehide", () => image.removeAttribute("src"));
openPreview();
