/** What of the page is open: theme, parameters, plan or 3D. */
import { forget } from "./colors.js";
import { $, el, memory } from "./dom.js";
import { icon } from "./icons.js";
import { set } from "./store.js";

const root = document.documentElement;
/** Below this width the parameters lie over the panes, so they start closed. */
const NARROW = "(max-width: 1180px)";

export function setUp() {
  const theme = memory.read("theme", null);
  if (theme) root.dataset.theme = theme;
  matchMedia("(prefers-color-scheme: light)").addEventListener("change", repaint);
  $("#theme-button").addEventListener("click", toggleTheme);
  showParams(memory.read("params", true) && !matchMedia(NARROW).matches);
  $("#params-button").addEventListener("click", toggleParams);
  for (const [tab, three] of [["#tab-bev", false], ["#tab-3d", true]]) $(tab).addEventListener("click", () => showThree(three));
  for (const button of document.querySelectorAll("[data-grow]")) {
    if (button.matches(".grow")) button.append(icon("grow"));
    button.addEventListener("click", () => grow(button.dataset.grow));
  }
  $(".tabs").addEventListener("keydown", (event) => {
    if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
    event.preventDefault();
    toggleThree();
    $(isThree() ? "#tab-3d" : "#tab-bev").focus();
  });
}

export function toggleTheme() {
  const isLight = root.dataset.theme ? root.dataset.theme === "light" : matchMedia("(prefers-color-scheme: light)").matches;
  root.dataset.theme = isLight ? "dark" : "light";
  memory.write("theme", root.dataset.theme);
  repaint();
}

function repaint() {
  forget();
  set("theme", root.dataset.theme ?? "system");
}

export function toggleParams() {
  const open = root.dataset.params === "closed";
  showParams(open);
  if (!matchMedia(NARROW).matches) memory.write("params", open);
}

function showParams(open) {
  root.dataset.params = open ? "open" : "closed";
  $("#params-button").setAttribute("aria-pressed", String(open));
}

/** Give a pane the whole workspace, or take it back. @param {"camera"|"bev"|"table"} pane */
export function grow(pane) {
  const { dataset } = $("#workspace");
  dataset.grown = dataset.grown === pane ? "" : pane;
  for (const button of document.querySelectorAll("[data-grow]")) button.setAttribute("aria-pressed", String(button.dataset.grow === dataset.grown));
}

const isThree = () => !$("#three-body").hidden;

export function toggleThree() {
  showThree(!isThree());
}

/** The 3D view is loaded when it is first looked at. */
function showThree(three) {
  const body = $("#three-body");
  body.hidden = !three;
  $("#bev-body").hidden = three;
  $("#bev-layers").hidden = three;
  $("#tab-3d").setAttribute("aria-selected", String(three));
  $("#tab-bev").setAttribute("aria-selected", String(!three));
  if (three && !body.firstChild) body.append(el("iframe", { src: "viser/", title: "3D view" }));
}
