// Small pictures, loaded a few at a time: a browser keeps six connections to one server, of which preview and events take
// two, and a click must not wait for thumbnails.

const FADE_MS = 300;

const shown = new WeakMap();
let asked = 0;

/** Those that are there already, and those that are made while one waits: these must not hold up the others. */
const lanes = { stored: { most: 2, loading: 0, waiting: [] }, made: { most: 1, loading: 0, waiting: [] } };

/**
 * Loads a picture into `image` when it is its turn in its lane. Answers whether there is one: if not, what was shown
 * before stays. Of several for the same image the one asked for last is shown in the end.
 */
export function loadPicture(image, url, lane = "stored") {
  const turn = ++asked;
  return new Promise((answer) => {
    const load = async () => {
      const picture = new Image();
      picture.src = url;
      const found = await picture.decode().then(() => true, () => false);
      if (found && turn > (shown.get(image) ?? 0)) {
        shown.set(image, turn);
        fadeTo(image, url);
      }
      answer(found);
    };
    lanes[lane].waiting.push({ image, load });
    next(lanes[lane]);
  });
}

/** Forgets the pictures of a lane whose turn has not come: others are wanted now. */
export function forgetWaiting(lane) {
  lanes[lane].waiting.length = 0;
}

async function next(lane) {
  if (lane.loading >= lane.most || lane.waiting.length === 0) return;
  lane.loading += 1;
  const seen = lane.waiting.findIndex(({ image }) => isSeen(image)); // what one sees first
  const [{ load }] = lane.waiting.splice(Math.max(seen, 0), 1);
  await load();
  lane.loading -= 1;
  next(lane);
}

/** Shows another picture, which is decoded already; the one before stays beneath until it is covered. */
function fadeTo(image, url) {
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  if (image.hasAttribute("src") && image.isConnected && !still) {
    const before = image.cloneNode();
    before.removeAttribute("id");
    image.before(before);
    image.animate({ opacity: [0, 1] }, FADE_MS).finished.catch(() => null).then(() => before.remove());
  }
  image.src = url;
}

function isSeen(image) {
  if (!image.isConnected) return true; // a tile's that is just being made, or one that is looked into
  const box = image.getBoundingClientRect();
  const strip = (image.closest("#environments") ?? document.documentElement).getBoundingClientRect();
  const right = Math.min(innerWidth, strip.right);
  return box.right > Math.max(0, strip.left) && box.left < right && box.bottom > 0 && box.top < innerHeight;
}
