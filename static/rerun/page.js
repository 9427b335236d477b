/**
 * The page around rerun's web viewer: it starts the viewer on this drive at this moment, and reports errors. The
 * viewer's script, loaded before this one, defines `wasm_bindgen`.
 */
import { NEEDS_WEBGL, webGl } from "../js/views/webgl.js";

/**
 * @typedef {Object} Handle
 * @property {(canvas: HTMLCanvasElement) => Promise<void>} start
 * @property {() => boolean} has_panicked
 * @property {() => string | undefined} panic_message
 */

/** @type {any} */
// @ts-expect-error a lexical global of the viewer's own script
const bindgen = wasm_bindgen;

const said = /** @type {HTMLElement} */ (document.getElementById("said"));
const canvas = /** @type {HTMLCanvasElement} */ (document.getElementById("viewer"));
const LOOK_EVERY_MS = 1000;

/** @param {string} text */
function say(text) {
  said.textContent = text;
  said.hidden = text === "";
}

/** Where the drive's recording is: the part that this page was asked for, which begins at the wanted moment. */
function recording() {
  const asked = new URLSearchParams(location.search);
  const part = new URLSearchParams();
  for (const name of ["first", "last", "paused", "compact"]) {
    const value = asked.get(name);
    if (value !== null && /^\d{1,9}$/.test(value)) part.set(name, value);
  }
  return `${location.origin}/api/rerun.rrd?${part}`;
}

/**
 * The viewer would ask its maker's servers for updates and tell them about its use. The policy of this page forbids it;
 * here such a request gets an empty answer before the browser has to refuse it. For the recording it asks without
 * cookies, and so without the token that a server may require: requests to this server get them.
 */
function stayHere() {
  const ask = window.fetch.bind(window);
  window.fetch = (input, init) => {
    const url = new URL(input instanceof Request ? input.url : String(input), location.href);
    const isOurs = url.origin === location.origin || url.protocol === "blob:" || url.protocol === "data:";
    if (!isOurs) return Promise.resolve(new Response(null, { status: 204 }));
    return ask(input, { ...init, credentials: "same-origin" });
  };
}

/** @param {Handle} handle */
function watch(handle) {
  if (handle.has_panicked()) {
    canvas.hidden = true;
    say(`rerun stopped: ${handle.panic_message() ?? "no reason given"}`);
    return;
  }
  setTimeout(watch, LOOK_EVERY_MS, handle);
}

async function open() {
  if (webGl() === "none") return say(`rerun ${NEEDS_WEBGL}`); // the viewer would only say that it found no adapter
  stayHere();
  await bindgen({ module_or_path: "/rerun/re_viewer_bg.wasm" });
  /** @type {Handle} */
  const handle = new bindgen.WebHandle({
    url: [recording()],
    hide_welcome_screen: true,
    enable_history: false,
    persist: false,
    notebook: false,
  });
  canvas.hidden = false;
  await handle.start(canvas);
  say("");
  document.documentElement.dataset.viewer = "started";
  watch(handle);
}

open().catch((error) => {
  canvas.hidden = true;
  say(`Cannot show rerun: ${error instanceof Error ? error.message : error}`);
});
