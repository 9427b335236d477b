/** Gutters for resizing panes, by drag or arrow keys. Sizes belong to the layout. */
import { $ } from "../core/dom.js";
import { get, on } from "../core/store.js";
import { change } from "./panes.js";

/**
 * A gutter: the CSS property it sets, the size for a pointer position, and its limits.
 * @typedef {object} Gutter
 * @property {string} property
 * @property {(x: number, y: number) => number} size
 * @property {() => [number, number]} limits
 */

const box = (/** @type {string} */ selector) => $(selector).getBoundingClientRect();
const GAP_PX = 6;

/** @type {Record<string, Gutter>} */
const GUTTERS = {
  camera: {
    property: "--camera-h",
    size: (_, y) => y - box(".main-column").top,
    limits: () => [110, box(".main-column").height - 90],
  },
  plan: {
    property: "--bev-w",
    size: (x) => box(".bev-pane").right - x,
    limits: () => [180, box(".bev-pane").right - box("#workspace").left - 280],
  },
  side: { property: "--side-w", size: (x) => box("#side").right - x, limits: () => [240, 560] },
  why: { property: "--why-h", size: (_, y) => y - box("#side").top, limits: () => [80, box("#side").height - 120] },
  timeline: {
    property: "--timeline-h",
    size: (_, y) => box(".timeline-pane").bottom - y,
    limits: () => [84, innerHeight * 0.7],
  },
};
const STEP_PX = 24;

export function setUp() {
  for (const node of document.querySelectorAll("[data-gutter]")) {
    const gutter = /** @type {HTMLElement} */ (node);
    gutter.addEventListener("pointerdown", (event) => start(gutter, event));
    gutter.addEventListener("keydown", (event) => nudge(gutter, event));
    gutter.addEventListener("dblclick", () => forget(gutter.dataset.gutter ?? ""));
  }
  on(["layout"], reflect);
  reflect();
}

function reflect() {
  const sizes = get("layout")?.sizes ?? {};
  for (const [name, { property }] of Object.entries(GUTTERS)) {
    if (sizes[name]) document.body.style.setProperty(property, `${sizes[name]}px`);
    else document.body.style.removeProperty(property);
  }
}

/** @param {HTMLElement} gutter @param {PointerEvent} event */
function start(gutter, event) {
  gutter.setPointerCapture(event.pointerId);
  gutter.classList.add("dragging");
  const move = (/** @type {PointerEvent} */ { clientX, clientY }) =>
    place(gutter.dataset.gutter ?? "", clientX, clientY);
  const end = () => {
    gutter.removeEventListener("pointermove", move);
    gutter.classList.remove("dragging");
  };
  gutter.addEventListener("pointermove", move);
  gutter.addEventListener("pointerup", end, { once: true });
  gutter.addEventListener("pointercancel", end, { once: true });
}

/** @param {HTMLElement} gutter @param {KeyboardEvent} event */
function nudge(gutter, event) {
  const isRow = gutter.classList.contains("row");
  const [less, more] = isRow ? ["ArrowUp", "ArrowDown"] : ["ArrowLeft", "ArrowRight"];
  const by = event.key === less ? -STEP_PX : event.key === more ? STEP_PX : 0;
  if (!by) return;
  event.preventDefault();
  event.stopPropagation();
  const at = gutter.getBoundingClientRect();
  place(
    gutter.dataset.gutter ?? "",
    at.left + at.width / 2 + (isRow ? 0 : by),
    at.top + at.height / 2 + (isRow ? by : 0),
  );
}

/** @param {string} name @param {number} x @param {number} y */
function place(name, x, y) {
  const [low, high] = GUTTERS[name].limits();
  const size = Math.round(Math.min(Math.max(GUTTERS[name].size(x, y) - GAP_PX / 2, low), high));
  change({ sizes: { ...get("layout")?.sizes, [name]: size } });
}

/** @param {string} name */
function forget(name) {
  const { [name]: _, ...rest } = get("layout")?.sizes ?? {};
  change({ sizes: rest });
}
