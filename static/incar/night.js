/** Night mode, dark and dim. Follows the system until the user chooses. */
import { forget } from "../js/core/colors.js";
import { $, memory, press } from "../js/core/dom.js";
import { set } from "../js/core/store.js";

const root = document.documentElement,
  button = $("#night");
const SYSTEM = matchMedia("(prefers-color-scheme: dark)");

export function setUp() {
  SYSTEM.addEventListener("change", show);
  button.addEventListener("click", () => {
    memory.write("drive.night", !isNight());
    show();
  });
  show();
}

/** @returns {boolean} */
function isNight() {
  return memory.read("drive.night", SYSTEM.matches);
}

function show() {
  root.dataset.theme = isNight() ? "dark" : "light";
  press(button, isNight());
  forget();
  set("theme", root.dataset.theme);
}
