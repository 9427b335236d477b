/**
 * The page's tooltip: help on hover, and the object under the pointer in a view.
 */
import { $ } from "./dom.js";

const GAP_PX = 6,
  POINTER_PX = 14;
const tip = $("#tooltip");

/** @param {HTMLElement} node @param {string} words */
export function attachTooltip(node, words) {
  node.addEventListener("pointerenter", () => show(node.getBoundingClientRect(), words));
  node.addEventListener("pointerleave", hideTip);
  const field = node instanceof HTMLLabelElement ? node.parentElement?.parentElement : node;
  field?.addEventListener("focusout", hideTip);
}

/** Show a tooltip beside the pointer. @param {number} x @param {number} y @param {string} words */
export function tipAt(x, y, words) {
  show({ left: x + POINTER_PX, top: y, bottom: y + POINTER_PX }, words);
}

export function hideTip() {
  if (!tip.hidden) tip.hidden = true;
}

/** @param {{left: number, top: number, bottom: number}} at @param {string} words */
function show(at, words) {
  tip.textContent = words;
  tip.hidden = false;
  const own = tip.getBoundingClientRect();
  const left = Math.min(Math.max(GAP_PX, at.left), innerWidth - own.width - GAP_PX);
  const below = at.bottom + GAP_PX;
  tip.style.left = `${left}px`;
  tip.style.top = `${below + own.height > innerHeight ? at.top - own.height - GAP_PX : below}px`;
}
