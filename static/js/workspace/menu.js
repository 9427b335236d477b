/** The page's popup menu, shown below its button. */
import { $ } from "../core/dom.js";

const GAP_PX = 4;
const menu = $("#menu");
/** @type {HTMLElement|null} */
let owner = null;

// entries that the server must be asked for come after it is shown
new ResizeObserver(() => owner && menu.matches(":popover-open") && place(owner)).observe(menu);

/**
 * @param {HTMLElement} button @param {string} label @param {() => (Node|string)[]} fill called on every opening
 */
export function attachMenu(button, label, fill) {
  button.setAttribute("aria-expanded", "false");
  button.addEventListener("click", ({ detail }) => {
    if (owner === button && menu.matches(":popover-open")) return menu.hidePopover();
    close();
    owner?.setAttribute("aria-expanded", "false");
    owner = button;
    menu.setAttribute("aria-label", label);
    menu.replaceChildren(...fill());
    menu.showPopover();
    place(button);
    button.setAttribute("aria-expanded", "true");
    if (detail === 0) focusFirst(); // pressed with a key
  });
  menu.addEventListener("toggle", (event) => {
    if (/** @type {ToggleEvent} */ (event).newState === "closed") button.setAttribute("aria-expanded", "false");
  });
}

/** Replace the contents while open. @param {HTMLElement} button @param {() => (Node|string)[]} fill */
export function refill(button, fill) {
  if (owner !== button || !menu.matches(":popover-open")) return;
  menu.replaceChildren(...fill());
  place(button);
}

export function close() {
  if (menu.matches(":popover-open")) menu.hidePopover();
}

function focusFirst() {
  const first = /** @type {HTMLElement|null} */ (menu.querySelector("button, a, input"));
  first?.focus();
}

/** Below the button if most of the window is there, else above it. @param {HTMLElement} button */
function place(button) {
  menu.style.left = "0"; // its text wraps at the window's edge: at the old place, it would be too narrow
  menu.style.maxHeight = "";
  const at = (button.checkVisibility() ? button : $("#more-button")).getBoundingClientRect(),
    own = menu.getBoundingClientRect();
  const below = at.bottom + GAP_PX,
    room = innerHeight - below - GAP_PX,
    isBelow = own.height <= room || room > innerHeight / 2;
  menu.style.left = `${Math.max(GAP_PX, Math.min(at.right - own.width, innerWidth - own.width - GAP_PX))}px`;
  menu.style.top = `${isBelow ? below : Math.max(GAP_PX, at.top - own.height - GAP_PX)}px`;
  if (isBelow) menu.style.maxHeight = `${room}px`;
}
