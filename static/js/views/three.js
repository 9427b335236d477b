/**
 * The 3D view, which the server draws for this page. Tells the server the selection and whether the view is visible.
 */
import { tell } from "../core/connection.js";
import { $, el } from "../core/dom.js";
import { get, on } from "../core/store.js";
import { NEEDS_WEBGL, webGl } from "./webgl.js";

/** Identifies this page's 3D view at the server. */
const NAME = [...crypto.getRandomValues(new Uint8Array(16))].map((each) => each.toString(16).padStart(2, "0")).join("");
/** Narrower frames are scaled down, since there the 3D view's own panel would cover the scene. */
const LEAST_PX = 600;
const SOFTWARE =
  "The 3D view is drawn without a graphics card and may be slow: see hardware acceleration in the browser's settings.";
/** viser's own notice of the same, by its id. */
const NOTICE_OF_VISER = "webgl-software-rendering";

export function setUp() {
  const body = $("#three-body");
  let isShown = false;
  const say = () => tell("hides_3d", body.firstChild !== null && (!isShown || document.hidden));
  new ResizeObserver(([{ contentRect }]) => {
    isShown = contentRect.width > 0 && contentRect.height > 0;
    if (isShown) fit(body, contentRect.width, contentRect.height);
    say();
  }).observe(body);
  document.addEventListener("visibilitychange", say);
  on(["selection"], () => tell("selected", get("selection")));
}

/** Load the 3D view, with a note until it is loaded. */
export function open() {
  const body = $("#three-body");
  if (body.firstChild) return;
  const drawsWith = webGl();
  if (drawsWith === "none") return body.append(el("p", { class: "busy", textContent: `The 3D view ${NEEDS_WEBGL}` }));
  tell("page_3d", NAME);
  const note = el("p", { class: "busy", aria: { role: "status" }, textContent: "Opening the 3D view …" });
  const view = el("iframe", { src: `viser/of/${NAME}/`, title: "3D view" });
  view.addEventListener("load", () => {
    note.remove();
    keepConnecting(view);
    if (drawsWith === "software") sayInPlace(view);
  });
  body.append(note, view);
}

/**
 * Say in the words of this page, until it is closed, what viser would say in its own.
 * @param {HTMLIFrameElement} view
 */
function sayInPlace(view) {
  const style = view.contentDocument?.createElement("style");
  if (style) {
    style.textContent = `#${NOTICE_OF_VISER} { display: none; }`;
    view.contentDocument?.head.append(style);
  }
  const close = el("button", { type: "button", class: "icon-button quiet", textContent: "✕", title: "Close" });
  close.setAttribute("aria-label", "Close this note");
  const said = el("p", { class: "three-note", aria: { role: "status" } }, el("span", { textContent: SOFTWARE }), close);
  close.addEventListener("click", () => said.remove());
  view.after(said);
}

/**
 * viser connects again after a lost connection only while its document has the focus, which is mostly in this page.
 * @param {HTMLIFrameElement} view
 */
function keepConnecting({ contentDocument }) {
  if (contentDocument) contentDocument.hasFocus = () => !document.hidden;
}

/** @param {HTMLElement} body @param {number} width @param {number} height */
function fit(body, width, height) {
  const scale = Math.min(1, width / LEAST_PX);
  body.style.setProperty("--three-width", `${width / scale}px`);
  body.style.setProperty("--three-height", `${height / scale}px`);
  body.style.setProperty("--three-scale", String(scale));
}
