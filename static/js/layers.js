/** What each view draws, as chips that remember. */
import { el, memory } from "./dom.js";
import { get, on, set } from "./store.js";

/** [key, label, what it is, palette role] by view. */
const CHIPS = {
  camera: [
    ["points", "Points", "LiDAR points in the picture, coloured by range", "path"],
    ["cuboids", "Cuboids", "Cuboids of LiDAR objects", "lidar"],
    ["lidarBoxes", "LiDAR boxes", "Image boxes around the cuboids, as fusion compares them", "lidar"],
    ["visionBoxes", "Vision boxes", "The detector's tracked boxes", "vision"],
    ["path", "Path", "The corridor laid on the ground", "path"],
  ],
  bev: [
    ["planPoints", "Points", "LiDAR points from above", "cluster"],
    ["velocity", "Motion", "Where each object will be relative to us in one second", "fused"],
    ["planPath", "Path", "The corridor", "path"],
  ],
};
const DEFAULTS = {
  points: true, cuboids: true, lidarBoxes: false, visionBoxes: true, path: true, planPoints: true, velocity: true, planPath: true,
};

export function setUp() {
  set("layers", { ...DEFAULTS, ...memory.read("layers", {}) });
  for (const [view, chips] of Object.entries(CHIPS)) {
    const buttons = chips.map(([key, label, title, role]) =>
      el("button", { type: "button", title, data: { layer: key }, style: { "--chip": `var(--cipv-${role})` }, onclick: () => toggle(key) }, label));
    document.getElementById(`${view}-layers`).append(...buttons);
  }
  on(["layers"], reflect);
  reflect();
}

/** @param {string} key */
export function toggle(key) {
  const layers = { ...get("layers"), [key]: !get("layers")[key] };
  memory.write("layers", layers);
  set("layers", layers);
}

function reflect() {
  const layers = get("layers");
  for (const button of document.querySelectorAll("[data-layer]")) button.setAttribute("aria-pressed", String(layers[button.dataset.layer]));
}
