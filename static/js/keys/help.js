/** What the keys do and what the colours mean. */
import { $, el } from "../core/dom.js";
import { keymap } from "./keymap.js";

const COLORS = [
  ["cipv", "CIPV: the closest vehicle in our path"],
  ["fused", "VL: camera and LiDAR agree"],
  ["vision", "V: the camera's boxes"],
  ["lidar", "L: LiDAR's boxes"],
  ["path", "our path"],
  ["ground", "ground points"],
  ["cluster", "clusters of no object yet"],
];
const dialog = $("#help-dialog", HTMLDialogElement);

export function show() {
  dialog.replaceChildren(
    el(
      "div",
      { class: "columns" },
      ...groups().map(group),
      el(
        "div",
        {},
        el("h2", { textContent: "Colours" }),
        ...COLORS.map(shade),
        el("p", { class: "facts", textContent: "Dashed: carried, not seen in this frame." }),
        el("p", { class: "facts", textContent: "Ribbon: plain VL, hatched upwards V, downwards L, faint carried." }),
      ),
      el(
        "div",
        {},
        el("h2", { textContent: "Hand" }),
        el("p", { textContent: "Plan: wheel zooms, dragging moves, double click fits." }),
        el("p", {
          textContent:
            "Timeline: press or drag to go there, wheel zooms, shift and wheel moves along, double click fits.",
        }),
        el("p", {
          textContent:
            "3D: dragging turns, wheel zooms, right drag moves; W A S D Q E and the arrows fly. Every other key does what it does everywhere; Esc gives them all back to the page.",
        }),
        el("h2", { textContent: "In the car" }),
        el("p", {}, el("a", { href: "drive/", textContent: "Display for a small screen, by touch" })),
      ),
    ),
    el("form", { method: "dialog" }, el("button", { textContent: "Close" })),
  );
  dialog.showModal();
  dialog.scrollTop = 0; // what can be focused first is far below
}

/** What can be done now comes first. @returns {import("./keymap.js").Group[]} */
const groups = () => [...keymap()].sort((a, b) => Number(isIdle(a)) - Number(isIdle(b)));

/** Whether it belongs to a mode that is off. @param {import("./keymap.js").Group} group */
const isIdle = ({ mode, bindings }) => mode !== undefined && bindings.every(({ isOn }) => isOn && !isOn());

/** @param {import("./keymap.js").Group} group */
function group({ title, mode, bindings }) {
  const taken = new Set(
    keymap()
      .flatMap((each) => (each.mode ? each.bindings : []))
      .filter(({ isOn }) => isOn?.())
      .flatMap(({ keys }) => keys),
  );
  return el(
    "div",
    { data: { mode: mode ?? "page" } },
    el("h2", { textContent: title }),
    ...bindings
      .filter(({ words, keys }) => words && (mode || !keys.every((key) => taken.has(key))))
      .map(({ shown, words }) =>
        el("div", { class: "pair" }, el("kbd", { textContent: shown }), el("span", { textContent: words })),
      ),
  );
}

/** @param {string[]} colour */
function shade([role, words]) {
  return el(
    "div",
    { class: "pair" },
    el("span", {}, el("span", { class: "swatch", style: { "--swatch": `var(--cipv-${role})` } }), words),
  );
}
