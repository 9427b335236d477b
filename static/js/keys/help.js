/** The help overlay: keyboard shortcuts, colours and links. */
import { $, el } from "../core/dom.js";
import { nameOf } from "./keyboard.js";
import { keymap } from "./keymap.js";
import { change, reset, shownAs } from "./own_keys.js";
import { styleOf, weights } from "../timeline/lanes/flags.js";

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
        el("h2", { textContent: "Events" }),
        ...weights().map((weight) =>
          el("div", {}, el("i", { class: "event-shape", style: styleOf(weight) }), weight.words),
        ),
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
            "3D: drag to orbit, scroll to zoom, right-drag to pan; W A S D Q E and arrow keys fly, " +
            "but while labeling they do the same as elsewhere on the page. " +
            "Other shortcuts always work; Esc returns all keys to the page.",
        }),
        el("h2", { textContent: "Documentation" }),
        el("p", {}, link("help/", "Help: how to use CIPV Studio")),
        el("h2", { textContent: "In-vehicle display" }),
        el("p", {}, el("a", { href: "drive/", textContent: "Touch display for small screens" })),
      ),
    ),
    el(
      "form",
      { method: "dialog" },
      el("button", { type: "button", textContent: "Change keys", onclick: edit }),
      el("button", { textContent: "Close" }),
    ),
  );
  if (!dialog.open) dialog.showModal();
  dialog.scrollTop = 0; // the first focusable element is at the bottom
}

/** A link that opens in a new tab. @param {string} href @param {string} words */
const link = (href, words) => el("a", { href, target: "_blank", rel: "noopener", textContent: words });

/** Active shortcuts come first. @returns {import("./keymap.js").Group[]} */
const groups = () => [...keymap()].sort((a, b) => Number(isIdle(a)) - Number(isIdle(b)));

/** The page on which keys are changed: press one, then the new key. */
function edit() {
  const said = el("p", { class: "facts", role: "status", textContent: "Click a key, then press the new one." });
  const shownGroups = keymap().filter(({ bindings }) => bindings.some(({ words }) => words));
  dialog.replaceChildren(
    el("h2", { textContent: "Keys" }),
    said,
    el("div", { class: "columns keys-page" }, ...shownGroups.map((each) => changeable(each, said))),
    el(
      "form",
      { method: "dialog" },
      el("button", {
        type: "button",
        textContent: "Reset all",
        onclick: () => {
          reset();
          edit();
        },
      }),
      el("button", { type: "button", textContent: "Back", onclick: show }),
      el("button", { textContent: "Close" }),
    ),
  );
  dialog.scrollTop = 0;
}

/** @param {import("./keymap.js").Group} group @param {HTMLElement} said */
const changeable = (group, said) =>
  el(
    "div",
    {},
    el("h2", { textContent: group.title }),
    ...group.bindings
      .filter(({ words }) => words)
      .map((binding) => {
        const button = el("button", {
          type: "button",
          class: binding.isOwn ? "key is-own" : "key",
          textContent: binding.shown,
          title: `Change the key: ${binding.words}`,
          onclick: () => listen(button, group, binding, said),
        });
        return el("div", { class: "pair" }, button, el("span", { textContent: binding.words }));
      }),
  );

/**
 * Wait for the new key; Escape keeps the old one.
 * @param {HTMLElement} button
 * @param {import("./keymap.js").Group} group
 * @param {import("./keymap.js").Binding} binding
 * @param {HTMLElement} said
 */
function listen(button, group, binding, said) {
  button.textContent = "press a key";
  const hear = (/** @type {KeyboardEvent} */ event) => {
    if (["Shift", "Control", "Alt", "Meta"].includes(event.key)) return;
    event.preventDefault();
    event.stopPropagation();
    end();
    if (event.key === "Escape") return edit();
    const name = nameOf(event),
      taken = change(keymap(), group, binding, name);
    if (!taken) return edit();
    button.textContent = binding.shown;
    said.textContent = `${shownAs(name)} is already used: ${taken}. Change that key first.`;
  };
  const end = () => {
    removeEventListener("keydown", hear, true);
    button.removeEventListener("blur", leave);
  };
  const leave = () => {
    end();
    button.textContent = binding.shown;
  };
  addEventListener("keydown", hear, true);
  button.addEventListener("blur", leave);
}

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
