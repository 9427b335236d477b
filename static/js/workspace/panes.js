/** Visible panes, the maximized pane, and the tab of the plan pane. */
import { $, memory, press } from "../core/dom.js";
import { icon } from "../core/icons.js";
import { get, on, set } from "../core/store.js";
import { open as openThree } from "../views/three.js";
import { showRerun } from "./rerun_tab.js";

/** @typedef {"camera"|"plan"|"objects"|"why"|"params"|"timeline"} Pane */
/** @typedef {"plan"|"3d"|"rerun"} Tab */
/**
 * @typedef {object} Layout
 * @property {Pane[]} hidden
 * @property {Pane|null} grown
 * @property {Tab} tab
 * @property {Record<string, number>} sizes  pixels by gutter; missing ones are automatic
 */

/** @type {Record<Pane, string>} in the order of their menu */
export const PANES = {
  camera: "Camera",
  plan: "Plan, 3D, rerun",
  objects: "Objects",
  why: "Why",
  params: "Parameters",
  timeline: "Timeline",
};
/** Panes covered by a maximized pane. @type {Pane[]} */
const COVERED = ["camera", "plan", "objects"];
/** @type {Layout} */
export const EVERYTHING = { hidden: [], grown: null, tab: "plan", sizes: {} };

/** Below this width the inspector overlays the panes, so it starts closed. The labels panel is beside them. */
const NARROW = matchMedia("(max-width: 1180px)");
const root = document.documentElement;

export function setUp() {
  set("layout", { ...EVERYTHING, ...memory.read("layout", {}), grown: null });
  root.dataset.inspect = NARROW.matches ? "closed" : "open";
  NARROW.addEventListener("change", () => {
    if (document.body.classList.contains("is-labeling")) showInspector(true);
    else resetInspector();
  });
  for (const button of document.querySelectorAll("[data-grow]")) {
    if (button.matches(".grow")) button.append(icon("grow"));
    button.addEventListener("click", () =>
      grow(/** @type {Pane} */ (/** @type {HTMLElement} */ (button).dataset.grow)),
    );
  }
  for (const button of plansTabs())
    button.addEventListener("click", (event) => {
      showTab(/** @type {Tab} */ (button.dataset.tab));
      if (event.detail) button.blur(); // after a press of the mouse, arrow keys are the page's, not the tabs'
    });
  $(".bev-pane .tabs").addEventListener("keydown", onTabKey);
  $("#params-button").addEventListener("click", toggleInspector);
  on(["layout"], reflect);
  reflect();
}

/** @returns {HTMLElement[]} */
const plansTabs = () =>
  [...document.querySelectorAll(".bev-pane [data-tab]")].map((tab) => /** @type {HTMLElement} */ (tab));
const layout = () => get("layout") ?? EVERYTHING;

/** @param {Partial<Layout>} changes */
export function change(changes) {
  set("layout", { ...layout(), ...changes });
  memory.write("layout", layout());
}

/** @param {Pane} pane @param {boolean} [shown] */
export function toggle(pane, shown = layout().hidden.includes(pane)) {
  const others = layout().hidden.filter((key) => key !== pane);
  change({ hidden: shown ? others : [...others, pane], grown: COVERED.includes(pane) ? null : layout().grown });
  if (shown && (pane === "why" || pane === "params")) showInspector(true);
}

/** Show a tab of the plan pane; if already shown, hide the pane. @param {Tab} tab */
export function toggleTab(tab) {
  if (layout().tab === tab) return toggle("plan");
  toggle("plan", true);
  showTab(tab);
}

/** @param {Tab} tab */
export function showTab(tab) {
  change({ tab });
}

export function nextTab() {
  showTab(layout().tab === "plan" ? "3d" : "plan");
}

/** Maximize a pane, or restore it. @param {Pane} pane */
export function grow(pane) {
  const grown = layout().grown === pane ? null : pane;
  change({ grown, hidden: grown ? layout().hidden.filter((key) => key !== pane) : layout().hidden });
}

export function toggleInspector() {
  showInspector(root.dataset.inspect === "closed");
}

/** Show the inspector where it overlays nothing. */
export function resetInspector() {
  showInspector(!NARROW.matches);
}

/** @param {boolean} shown */
function showInspector(shown) {
  root.dataset.inspect = shown ? "open" : "closed";
  press($("#params-button"), shown);
}

function reflect() {
  const { hidden, grown, tab } = layout();
  for (const node of document.querySelectorAll("[data-pane]")) {
    const pane = /** @type {HTMLElement} */ (node);
    pane.hidden = hidden.includes(/** @type {Pane} */ (pane.dataset.pane));
    pane.classList.toggle("is-grown", pane.dataset.pane === grown);
  }
  for (const node of document.querySelectorAll(".column")) {
    const column = /** @type {HTMLElement} */ (node);
    const panes = [...column.querySelectorAll("[data-pane]")].map(
      (pane) => !(/** @type {HTMLElement} */ (pane).hidden),
    );
    column.hidden = !panes.some(Boolean);
    $(".gutter", HTMLElement, column).hidden = !panes.every(Boolean);
  }
  hideGutters();
  for (const button of document.querySelectorAll("[data-grow]"))
    press(button, /** @type {HTMLElement} */ (button).dataset.grow === grown);
  press($("#params-button"), root.dataset.inspect !== "closed");
  reflectTab(tab);
}

/** Hide gutters that have nothing to resize. */
function hideGutters() {
  const plan = $(".bev-pane"),
    main = $(".main-column"),
    side = $("#side");
  $("[data-gutter=plan]").hidden = plan.hidden || main.hidden;
  $("[data-gutter=side]").hidden = side.hidden || (plan.hidden && main.hidden);
  $("[data-gutter=timeline]").hidden = $(".timeline-pane").hidden;
}

/** Show a tab; the 3D view and rerun are loaded on first use. @param {Tab} shown */
function reflectTab(shown) {
  for (const button of plansTabs()) {
    const isShown = button.dataset.tab === shown;
    button.setAttribute("aria-selected", String(isShown));
    button.tabIndex = isShown ? 0 : -1;
    $(`#${button.getAttribute("aria-controls")}`).hidden = !isShown;
  }
  $("#bev-layers").hidden = shown !== "plan";
  if (shown === "3d") openThree();
  if (shown === "rerun") showRerun($("#rerun-body"));
}

/** @param {KeyboardEvent} event */
function onTabKey(event) {
  const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (!by) return;
  event.preventDefault();
  const tabs = plansTabs(),
    at = tabs.findIndex((tab) => tab.dataset.tab === layout().tab);
  const next = tabs[(at + by + tabs.length) % tabs.length];
  showTab(/** @type {Tab} */ (next.dataset.tab));
  next.focus();
}
