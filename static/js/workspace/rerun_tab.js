/** The current recording in rerun's web viewer, served by this server. */
import { request } from "../core/api.js";
import { el } from "../core/dom.js";
import { NO_DRIVE } from "../drive/live_buffer.js";
import { get } from "../core/store.js";
import { NEEDS_WEBGL, webGl } from "../views/webgl.js";

/** Narrower panes use the compact blueprint. */
const NARROW_PX = 900;
const NO_WEBGL = `rerun ${NEEDS_WEBGL} Save the recording (.rrd) and open it in rerun's own viewer.`;

/**
 * @param {HTMLElement} body container of the viewer
 */
export async function showRerun(body) {
  if (!body.querySelector("iframe")) await load(body);
}

/** @param {HTMLElement} body @param {number} [from] first frame; else the current one */
async function load(body, from) {
  if (get("state")?.live) return void body.replaceChildren(el("p", { class: "facts pad", textContent: NO_DRIVE }));
  if (webGl() === "none")
    return void body.replaceChildren(bar(body, ""), el("p", { class: "busy", textContent: NO_WEBGL }));
  const note = el("p", { class: "busy", textContent: "Opening rerun …" });
  body.replaceChildren(note);
  try {
    const query = new URLSearchParams({ compact: String(Number(body.clientWidth < NARROW_PX)) });
    if (from !== undefined) query.set("first", String(from));
    const { url, first, last } = await request(`api/rerun/open?${query}`);
    body.replaceChildren(
      bar(body, `frames ${first + 1} to ${last + 1} of ${get("state")?.count ?? 0}`),
      el("iframe", { src: url, title: "rerun", class: "below-bar" }),
    );
  } catch (problem) {
    note.textContent = /** @type {Error} */ (problem).message;
    body.append(bar(body, ""));
  }
}

/** @param {HTMLElement} body @param {string} what what is open */
function bar(body, what) {
  const save = el("a", {
    href: "api/rerun.rrd",
    textContent: "Save .rrd",
    title: "100 frames around this one, for the native viewer",
  });
  save.setAttribute("download", "");
  return el(
    "div",
    { class: "rerun-bar" },
    el("span", { class: "facts", textContent: what }),
    el("span", { class: "spacer" }),
    save,
    el("button", {
      type: "button",
      textContent: "Start",
      title: "Open from the start",
      onclick: () => load(body, 0),
    }),
    el("button", {
      type: "button",
      textContent: "Here",
      title: "Open from the current frame",
      onclick: () => load(body),
    }),
  );
}
