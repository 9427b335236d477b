/** Dark or light theme: follows the system until the user chooses. */
import { forget } from "../core/colors.js";
import { $, memory } from "../core/dom.js";
import { set } from "../core/store.js";

const root = document.documentElement;
const SYSTEM = matchMedia("(prefers-color-scheme: light)");

export function setUp() {
  const theme = memory.read("theme", "");
  if (theme) root.dataset.theme = theme;
  SYSTEM.addEventListener("change", repaint);
  $("#theme-button").addEventListener("click", toggleTheme);
}

export function toggleTheme() {
  const isLight = root.dataset.theme ? root.dataset.theme === "light" : SYSTEM.matches;
  root.dataset.theme = isLight ? "dark" : "light";
  memory.write("theme", root.dataset.theme);
  repaint();
}

function repaint() {
  forget();
  set("theme", root.dataset.theme ?? "system");
}
