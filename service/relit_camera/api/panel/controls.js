// The controls: loaded when the first picture is there, so that it waits for none of them.

import "./light/ball.js";
import "./light/sliders.js";
import "./light/look_tiles.js";
import "./library/places.js";
import "./library/avatar.js";
import "./library/faces.js";
import "./library/presets.js";
import "./camera/devices.js";
import "./first/doors.js";
import "./first/checklist.js";
import "./first/ladder.js";
import { loadAll } from "./library/stored.js";
import { on } from "./stage/events.js";

on("open", loadAll);
loadAll();
