/** Keys of the whole page; not while somebody types, and a focused slider keeps its arrows. */
import { playback } from "./api.js";
import * as help from "./help.js";
import { toggle as toggleLayer } from "./layers.js";
import * as sources from "./sources.js";
import { get, set } from "./store.js";
import { shiftSpeed, toggleLoop, togglePlay } from "./transport.js";
import { grow, toggleParams, toggleTheme, toggleThree } from "./window.js";

const CAMERA_LAYERS = ["points", "cuboids", "lidarBoxes", "visionBoxes", "path"];
const ACTIONS = {
  " ": togglePlay,
  ArrowLeft: (event) => playback({ step: event.shiftKey ? -10 : -1 }),
  ArrowRight: (event) => playback({ step: event.shiftKey ? 10 : 1 }),
  Home: () => playback({ seek: 0 }),
  End: () => playback({ seek: Math.max(0, (get("state")?.count ?? 1) - 1) }),
  "[": () => shiftSpeed(-1),
  "]": () => shiftSpeed(1),
  l: toggleLoop,
  b: toggleThree,
  m: () => grow("bev"),
  p: toggleParams,
  o: sources.open,
  d: toggleTheme,
  "?": help.show,
  Escape: () => set("selection", null),
};

export function setUp() {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented || isTaken(event)) return;
    const layer = CAMERA_LAYERS[Number(event.key) - 1];
    const action = layer ? () => toggleLayer(layer) : ACTIONS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action(event);
  });
}

/** True when the focused element means the key for itself. */
function isTaken({ target, key }) {
  if (document.querySelector("dialog[open]")) return true;
  if (!(target instanceof HTMLElement)) return false;
  if (target.matches("select, textarea, input:not([type=range]):not([type=checkbox])")) return true;
  if (target.matches("input[type=range]")) return key.startsWith("Arrow") || key === "Home" || key === "End";
  return key === " " && target.matches("button, summary, input");
}
