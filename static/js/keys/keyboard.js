/** Global keyboard shortcuts (keymap.js). Ignored while typing; a focused slider keeps its arrow keys. */
import { $ } from "../core/dom.js";
import { on } from "../core/store.js";
import { isOn as isLabeling } from "../labeling/state/mode.js";
import { keymap } from "./keymap.js";

/**
 * Camera movement keys of the 3D view (viser's CAMERA_MOVEMENT_KEYS), with any modifier. While the view has the focus,
 * they only move its camera; while labeling, they are the page's and do not move it.
 */
const FLYING = new Set([
  "KeyW",
  "KeyA",
  "KeyS",
  "KeyD",
  "KeyQ",
  "KeyE",
  "ArrowUp",
  "ArrowDown",
  "ArrowLeft",
  "ArrowRight",
]);

export function setUp() {
  let bindings = keymap().flatMap((group) => group.bindings);
  on(["keys", "person"], () => (bindings = keymap().flatMap((group) => group.bindings)));
  const act = (/** @type {KeyboardEvent} */ event) => {
    if (event.altKey || event.defaultPrevented || isTaken(event)) return;
    const name = nameOf(event),
      binding = bindings.find(({ keys, isOn }) => keys.includes(name) && (isOn?.() ?? true));
    if (!binding) return;
    event.preventDefault();
    binding.act();
  };
  document.addEventListener("keydown", act);
  // the 3D view is a same-origin iframe, so listen in it too
  $("#three-body").addEventListener(
    "load",
    ({ target }) => target instanceof HTMLIFrameElement && hearIn(target, act),
    true,
  );
}

/** @param {HTMLIFrameElement} view @param {(event: KeyboardEvent) => void} act */
function hearIn(view, act) {
  const page = view.contentDocument;
  page?.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && !event.defaultPrevented) giveBack(view);
    else if (!FLYING.has(event.code)) act(event);
  });
  const beforeCamera = (/** @type {KeyboardEvent} */ event) => {
    if (!isLabeling() || !FLYING.has(event.code) || isTaken(event)) return;
    event.stopPropagation();
    act(event);
  };
  page?.addEventListener("keydown", beforeCamera, true);
}

/** Return keyboard focus to the page. @param {HTMLIFrameElement} view */
function giveBack(view) {
  view.blur();
  window.focus();
}

/**
 * Key name: "Shift+1", "Ctrl+z", "?", "Space". The row of digits gives digits in every keyboard layout, also in those
 * that type them with Shift (French, Czech).
 * @param {KeyboardEvent} event
 */
export function nameOf(event) {
  const { key, code, shiftKey, ctrlKey, metaKey } = event;
  const digit = event.getModifierState("AltGraph") ? undefined : /^Digit(\d)$/.exec(code)?.[1]; // AltGr: [ ] and more
  const bare =
    key === " " ? "Space" : (digit ?? (key.length === 1 && !shiftKey ? key.toLowerCase() : key));
  const isSaid = shiftKey && (digit !== undefined || bare.length > 1 || bare.toLowerCase() !== bare.toUpperCase());
  return `${ctrlKey || metaKey ? "Ctrl+" : ""}${isSaid ? "Shift+" : ""}${bare}`;
}

/** Whether the focused element handles the key itself. @param {KeyboardEvent} event */
function isTaken({ target, key, ctrlKey, metaKey }) {
  if (document.querySelector("dialog[open]") || (key === "Escape" && document.querySelector(":popover-open")))
    return true;
  const focused = /** @type {Element} */ (target); // maybe another page's, whose elements are none of our HTMLElement
  // a field of a dialog that has just closed keeps the focus until the page is painted
  if (!("matches" in focused) || !focused.checkVisibility()) return false;
  if (focused.matches("select, textarea, input:not([type=range]):not([type=checkbox])")) return true;
  if (ctrlKey || metaKey) return false;
  if (focused.matches("input[type=range]")) return key.startsWith("Arrow") || key === "Home" || key === "End";
  return key === " " && focused.matches("button, summary, input, a");
}
