/** The menu of what the top bar has no room for: its buttons and links that the window is too narrow to show. */
import { $, el } from "../core/dom.js";
import { attachMenu, close } from "./menu.js";

export function setUp() {
  attachMenu($("#more-button"), "More", fill);
}

const fill = () =>
  [...document.querySelectorAll(".topbar .wide-only")].map((each) => item(/** @type {HTMLElement} */ (each)));

/** An entry that looks and acts as the hidden one. @param {HTMLElement} hidden */
function item(hidden) {
  const entry = /** @type {HTMLElement} */ (hidden.cloneNode(true));
  entry.removeAttribute("id");
  entry.classList.add("item");
  entry.addEventListener("click", () => {
    if (!hidden.classList.contains("either")) close(); // which says in its own text what it has done
    if (hidden instanceof HTMLButtonElement) hidden.dispatchEvent(new MouseEvent("click", { detail: 0 }));
  });
  return entry;
}
