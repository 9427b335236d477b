/** One tooltip for the page: help that appears on hover and on keyboard focus. */
import { $ } from "./dom.js";

const GAP_PX = 6;
const tip = $("#tooltip");

/** @param {HTMLElement} node @param {string} words */
export function attachTooltip(node, words) {
  node.addEventListener("pointerenter", () => show(node, words));
  node.addEventListener("pointerleave", hide);
  const field = node instanceof HTMLLabelElement ? node.parentElement?.parentElement : node;
  field?.addEventListener("focusout", hide);
}

/** @param {HTMLElement} node @param {string} words */
function show(node, words) {
  tip.textContent = words;
  tip.hidden = false;
  const at = node.getBoundingClientRect(), own = tip.getBoundingClientRect();
  const left = Math.min(Math.max(GAP_PX, at.left), innerWidth - own.width - GAP_PX);
  const below = at.bottom + GAP_PX;
  tip.style.left = `${left}px`;
  tip.style.top = `${below + own.height > innerHeight ? at.top - own.height - GAP_PX : below}px`;
}

function hide() {
  tip.hidden = true;
}
