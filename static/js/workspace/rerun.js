/** This drive at this moment in rerun's own viewer, whose files our server serves. */
import { request } from "../api.js";
import { el } from "../dom.js";
import { NO_DRIVE } from "../drive/live.js";
import { get } from "../store.js";

/** @param {HTMLElement} body the pane that the viewer is put into, once there is one; a press of its button opens it anew */
export async function showRerun(body) {
  if (!body.querySelector("iframe")) await load(body);
}

/** @param {HTMLElement} body */
async function load(body) {
  if (get("state")?.live) return void body.replaceChildren(el("p", { class: "facts pad", textContent: NO_DRIVE }));
  const note = el("p", { class: "busy", textContent: "Opening rerun …" });
  body.replaceChildren(note);
  try {
    const { url } = await request("api/rerun/open");
    body.replaceChildren(bar(body), el("iframe", { src: url, title: "rerun", class: "below-bar" }));
  } catch (problem) {
    note.textContent = /** @type {Error} */ (problem).message;
    body.append(bar(body));
  }
}

/** @param {HTMLElement} body */
function bar(body) {
  const save = el("a", { href: "api/rerun.rrd", textContent: "Save .rrd", title: "For the native viewer: 100 frames around this one" });
  save.setAttribute("download", "");
  const moment = `frame ${(get("state")?.index ?? 0) + 1}`;
  return el("div", { class: "rerun-bar" }, el("span", { class: "facts", textContent: moment }), el("span", { class: "spacer" }), save,
    el("button", { type: "button", textContent: "Open at the shown frame", onclick: () => load(body) }));
}
