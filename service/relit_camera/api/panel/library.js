// What is stored: environments, background pictures, subjects, presets.

import { attempt, request, toast } from "./api.js";
import { ask, make, storedName, tile } from "./widgets.js";

const MOST_BYTES = 64 * 1024 * 1024;

/** Holds the stored collections and draws those that are lists. `scene()` is the scene as it now stands, or null. */
export class Library {
  constructor(scene, setLighting, setBackground) {
    this.scene = scene;
    this.setLighting = setLighting;
    this.setBackground = setBackground;
    this.stored = { environments: [], backgrounds: [], subjects: [], presets: [] };
    const environmentFile = document.getElementById("environment-file");
    environmentFile.onchange = () => this.#upload(environmentFile, "environments", (name) => setLighting({ environment: name }));
    const backgroundFile = document.getElementById("background-file");
    backgroundFile.onchange = () => this.#upload(backgroundFile, "backgrounds", (name) => setBackground({ kind: "image", image: name }));
    document.getElementById("preset-save").onclick = () => this.#savePreset();
    document.getElementById("subject").onchange = (event) => attempt("PUT", "subject", { name: event.target.value || null });
  }

  async load(collection) {
    const items = await attempt("GET", collection);
    if (items) this.stored[collection] = items;
    this.draw();
  }

  async loadAll() {
    await Promise.all(Object.keys(this.stored).map((collection) => this.load(collection)));
  }

  draw() {
    this.#drawEnvironments();
    this.#drawSubjects();
    this.#drawPresets();
  }

  /** Tiles of the pictures that a background may be. */
  backgroundTiles(chosen) {
    return this.stored.backgrounds.map((item) =>
      tile({
        name: item.name,
        picture: item.thumbnail,
        chosen: item.name === chosen,
        onChoose: () => this.setBackground({ kind: "image", image: item.name }),
        onDelete: () => remove("backgrounds", item.name),
      }),
    );
  }

  #drawEnvironments() {
    const chosen = this.scene()?.lighting.environment;
    const use = (name) => this.setLighting({ environment: name });
    const tiles = this.stored.environments.map((item) =>
      tile({
        name: item.name,
        picture: item.thumbnail,
        chosen: item.name === chosen,
        onChoose: () => use(item.name),
        onDelete: item.builtin || item.temporary ? null : () => remove("environments", item.name),
      }),
    );
    tiles.push(tile({ name: "Background", title: "Lit by the virtual background", symbol: "▣", chosen: chosen === "background", onChoose: () => use("background") }));
    tiles.push(tile({ name: "Lamps only", title: "No environment", symbol: "✦", chosen: chosen === null, onChoose: () => use(null) }));
    refill(document.getElementById("environments"), tiles);
  }

  #drawSubjects() {
    const current = this.scene()?.subject ?? "";
    const names = this.stored.subjects.map((item) => item.name);
    if (current && !names.includes(current)) names.push(current);
    const options = [["", "Nobody (unlit)"], ...names.map((name) => [name, name])];
    const hidden = !current && this.scene()?.unlit_allowed === false; // nobody is captured yet, and nothing is shown
    if (hidden) options.unshift(["?", "Nobody yet (hidden)"]);
    const select = document.getElementById("subject");
    select.replaceChildren(...options.map(([value, text]) => make("option", { value, selected: value === (hidden ? "?" : current) }, text)));
  }

  #drawPresets() {
    const chips = this.stored.presets.map(({ name }) => {
      const apply = make("button", { type: "button", title: `Show ${name}` }, name);
      apply.onclick = () => attempt("POST", `presets/${encodeURIComponent(name)}/apply`);
      const close = make("button", { type: "button", className: "close", "aria-label": `Delete preset ${name}` }, "×");
      close.onclick = () => remove("presets", name);
      return make("li", {}, apply, close);
    });
    refill(document.getElementById("presets"), chips);
    document.getElementById("presets-none").hidden = chips.length > 0;
  }

  async #savePreset() {
    const name = await ask("Name of the preset", "Save", "");
    if (name) await attempt("PUT", `presets/${encodeURIComponent(name)}`);
  }

  async #upload(input, collection, then) {
    const [file] = input.files;
    input.value = "";
    if (!file) return;
    if (file.size > MOST_BYTES) {
      toast(`${file.name} has ${Math.round(file.size / 1e6)} MB`, "The largest that is taken has 67 MB; scale it down");
      return;
    }
    const form = new FormData();
    const name = storedName(file.name);
    form.append("name", name);
    form.append("file", file);
    try {
      await request("POST", collection, form);
    } catch {
      return; // the toast has said why
    }
    await this.load(collection);
    then(name);
  }
}

async function remove(collection, name) {
  if (await ask(`Delete “${name}”?`, "Delete")) await attempt("DELETE", `${collection}/${encodeURIComponent(name)}`);
}

/** Replaces the children, and keeps the keyboard's place among them. */
function refill(parent, children) {
  const focused = [...parent.querySelectorAll("button")].indexOf(document.activeElement);
  parent.replaceChildren(...children);
  if (focused >= 0) parent.querySelectorAll("button")[focused]?.focus();
}
