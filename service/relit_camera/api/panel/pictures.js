// Small pictures, loaded a few at a time: a browser keeps six connections to one server, of which preview and events take
// two, and a click must not wait for thumbnails.

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
    lanes[lane].waiting.push(async () => {
      const picture = new Image();
      picture.src = url;
      const found = await picture.decode().then(() => true, () => false);
      if (found && turn > (shown.get(image) ?? 0)) {
        shown.set(image, turn);
        image.src = url;
      }
      answer(found);
    });
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
  await lane.waiting.shift()();
  lane.loading -= 1;
  next(lane);
}
