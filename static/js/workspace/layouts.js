/** Layouts: panes, sizes and layers. Built-in ones, and those saved in this browser. */
import { $, el, memory } from "../core/dom.js";
import { get, set } from "../core/store.js";
import { attachMenu, close, refill } from "./menu.js";
import { EVERYTHING, PANES, change, toggle } from "./panes.js";

/** @typedef {import("./panes.js").Layout} Layout */
/** @typedef {import("./panes.js").Pane} Pane */
/** @typedef {Partial<Layout> & {layers?: Record<string, boolean>}} Saved */

/** @type {Record<string, Saved>} */
const BUILT_IN = {
  Everything: {},
  Camera: { hidden: ["objects", "params", "plan"] },
  Charts: { hidden: ["objects", "plan", "params"], sizes: { timeline: 420 } },
  Tuning: { hidden: ["objects"], sizes: { timeline: 260 } },
};

const button = $("#layout-button");

export function setUp() {
  attachMenu(button, "Layout", fill);
}

/** @returns {Record<string, Saved>} */
const saved = () => memory.read("layouts", {});

function fill() {
  const hidden = get("layout")?.hidden ?? [];
  const panes = Object.entries(PANES).map(([pane, label]) =>
    el(
      "label",
      { class: "item" },
      el("input", {
        type: "checkbox",
        checked: !hidden.includes(/** @type {Pane} */ (pane)),
        onchange: () => toggle(/** @type {Pane} */ (pane)),
      }),
      label,
    ),
  );
  const name = el("input", { type: "text", placeholder: "Name", maxLength: 40, aria: { label: "Layout name" } });
  const form = el(
    "form",
    { class: "menu-row", onsubmit: (/** @type {Event} */ event) => save(event, name.value) },
    name,
    el("button", { textContent: "Save" }),
  );
  return [
    el("h3", { textContent: "Panes" }),
    ...panes,
    el("h3", { textContent: "Layouts" }),
    ...Object.entries(BUILT_IN).map(([key, layout]) => item(key, layout)),
    ...Object.entries(saved()).map(([key, layout]) => item(key, layout, true)),
    form,
  ];
}

/** @param {string} name @param {Saved} layout @param {boolean} [isOwn] */
function item(name, layout, isOwn = false) {
  const use = el("button", { type: "button", class: "item", textContent: name, onclick: () => apply(layout) });
  if (!isOwn) return use;
  return el(
    "div",
    { class: "menu-row" },
    use,
    el("button", {
      type: "button",
      class: "drop",
      textContent: "✕",
      aria: { label: `Delete layout ${name}` },
      onclick: () => forget(name),
    }),
  );
}

/** @param {Saved} layout */
export function apply({ layers, ...panes }) {
  change({ ...EVERYTHING, ...panes });
  if (layers) set("layers", { ...get("layers"), ...layers });
  close();
}

/** Validate a layout from an untrusted object; null if there is none. @param {any} given @returns {Saved|null} */
export function checked(given) {
  if (!given) return null;
  /** @type {Saved} */
  const layout = {};
  if (Array.isArray(given.hidden)) layout.hidden = given.hidden.filter((/** @type {string} */ pane) => pane in PANES);
  if (["plan", "3d", "rerun"].includes(given.tab)) layout.tab = given.tab;
  if (given.grown in PANES) layout.grown = given.grown;
  layout.sizes = only(given.sizes, Number.isFinite);
  layout.layers = only(given.layers, (value) => typeof value === "boolean");
  return layout;
}

/** Entries whose value fits. @param {any} given @param {(value: unknown) => boolean} fits @returns {any} */
function only(given, fits) {
  return Object.fromEntries(Object.entries(given ?? {}).filter(([, value]) => fits(value)));
}

/** The current layout, as `apply` takes it. @returns {Saved} */
export function current() {
  return { ...(get("layout") ?? EVERYTHING), layers: get("layers") ?? {} };
}

/** @param {Event} event @param {string} name */
function save(event, name) {
  event.preventDefault();
  if (!name.trim()) return;
  memory.write("layouts", { ...saved(), [name.trim()]: current() });
  refill(button, fill);
}

/** @param {string} name */
function forget(name) {
  const { [name]: _, ...rest } = saved();
  memory.write("layouts", rest);
  refill(button, fill);
}
