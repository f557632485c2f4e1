// The camera's events, heard by whoever asks, while the page is looked at.

const RETRY_MS = 1000;

const heard = new Map();
let source = null;
let retry = 0;

/** Calls `callback(data)` at each event of a kind; also `open` and `lost`, which tell of the connection itself. */
export function on(kind, callback) {
  if (!heard.has(kind)) {
    heard.set(kind, []);
    if (source) listen(kind);
  }
  heard.get(kind).push(callback);
}

function tell(kind, data) {
  for (const callback of heard.get(kind) ?? []) callback(data);
}

function listen(kind) {
  source.addEventListener(kind, (event) => {
    if (event.data !== undefined) tell(kind, JSON.parse(event.data));
  });
}

/** Begins to listen; again after the page was hidden: a browser keeps only six connections to one server. */
export function openEvents() {
  clearTimeout(retry);
  source?.close();
  source = null;
  if (document.hidden) return;
  source = new EventSource("/api/v1/events");
  for (const kind of heard.keys()) if (kind !== "open" && kind !== "lost") listen(kind);
  source.onopen = () => tell("open");
  source.onerror = () => {
    const refused = source.readyState === EventSource.CLOSED; // else the browser tries again by itself
    if (refused) retry = setTimeout(openEvents, RETRY_MS);
    tell("lost", { refused });
  };
}

document.addEventListener("visibilitychange", openEvents);
addEventListener("pagehide", () => source?.close());
