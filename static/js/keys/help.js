/** The help overlay: keyboard shortcuts, colours and links. */
import { $, el } from "../core/dom.js";
import { keymap } from "./keymap.js";

const COLORS = [
  ["cipv", "CIPV: closest in-path vehicle"],
  ["fused", "VL: camera and LiDAR"],
  ["vision", "V: camera only"],
  ["lidar", "L: LiDAR only"],
  ["path", "ego path"],
  ["ground", "ground points"],
  ["cluster", "unassigned clusters"],
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
        el("p", { class: "facts", textContent: "Dashed: carried (not detected in this frame)." }),
        el("p", { class: "facts", textContent: "Timeline: solid VL, hatched up V, hatched down L, faint carried." }),
      ),
      el(
        "div",
        {},
        el("h2", { textContent: "Mouse and touch" }),
        el("p", { textContent: "Plan: scroll to zoom, drag to pan, double-click to reset." }),
        el("p", {
          textContent:
            "Timeline: click or drag to seek, scroll to zoom, Shift + scroll to pan, double-click to show all.",
        }),
        el("p", {
          textContent:
            "3D: drag to orbit, scroll to zoom, right-drag to pan; W A S D Q E and arrow keys fly. " +
            "Other shortcuts work as usual; Esc returns all keys to the page.",
        }),
        el("h2", { textContent: "Documentation" }),
        el("p", {}, link("help/", "Help: how to use CIPV Studio")),
        el("h2", { textContent: "In-vehicle display" }),
        el("p", {}, el("a", { href: "drive/", textContent: "Touch display for small screens" })),
      ),
    ),
    el("form", { method: "dialog" }, el("button", { textContent: "Close" })),
  );
  dialog.showModal();
  dialog.scrollTop = 0; // the first focusable element is at the bottom
}

/** A link that opens in a new tab. @param {string} href @param {string} words */
const link = (href, words) => el("a", { href, target: "_blank", rel: "noopener", textContent: words });

/** Active shortcuts come first. @returns {import("./keymap.js").Group[]} */
const groups = () => [...keymap()].sort((a, b) => Number(isIdle(a)) - Number(isIdle(b)));

/** Whether a group belongs to an inactive mode. @param {import("./keymap.js").Group} group */
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
