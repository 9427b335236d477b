/** What the keys do and what the colours mean. */
import { $, el } from "./dom.js";

const KEYS = [
  ["Space", "play or pause"], ["← →", "one frame back or on"], ["Shift ← →", "ten frames"], ["Home End", "first or last frame"],
  ["[ ]", "slower or faster"], ["L", "loop"], ["1 … 5", "camera layers"], ["B", "plan or 3D"], ["M", "plan or 3D large"], ["P", "parameters"],
  ["O", "open a recording"], ["D", "dark or light"], ["Esc", "deselect"], ["?", "this help"],
];
const COLORS = [
  ["cipv", "CIPV: the closest vehicle in our path"], ["fused", "VL: camera and LiDAR agree"], ["vision", "V: the camera's boxes"],
  ["lidar", "L: LiDAR's boxes"], ["path", "our path"], ["ground", "ground points"], ["cluster", "clusters of no object yet"],
];

export function show() {
  const dialog = $("#help-dialog");
  const pair = ([key, words]) => el("div", { class: "pair" }, el("kbd", { textContent: key }), el("span", { textContent: words }));
  const shade = ([role, words]) => el("div", { class: "pair" }, el("span", {}, el("span", { class: "swatch", style: { "--swatch": `var(--cipv-${role})` } }), words));
  dialog.replaceChildren(
    el("div", { class: "columns" }, el("div", {}, el("h2", { textContent: "Keyboard" }), ...KEYS.map(pair)),
      el("div", {}, el("h2", { textContent: "Colours" }), ...COLORS.map(shade),
        el("p", { class: "facts", textContent: "Dashed: carried, not seen in this frame." }),
        el("h2", { textContent: "Plan" }), el("p", { textContent: "Wheel zooms, dragging moves, double click fits." }))),
    el("form", { method: "dialog" }, el("button", { textContent: "Close" })));
  dialog.showModal();
}
