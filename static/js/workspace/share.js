/**
 * A link to what is on the screen: recording, frame, selection, parameters, layout. It is the address's hash, which no
 * server sees. A link is applied once and then taken off the address, so that a reload does not turn back time.
 */
import { playback, request } from "../api.js";
import { $, el } from "../dom.js";
import { seekTo } from "../drive/seek.js";
import { get, on, set } from "../store.js";
import * as layouts from "./layouts.js";

/** @typedef {import("../types.js").ParamValue} ParamValue */
/**
 * @typedef {object} Shared
 * @property {string|null} uri
 * @property {number|null} index
 * @property {number|null} selection
 * @property {string|null} preset
 * @property {Record<string, ParamValue>} values  those that differ from the preset's
 * @property {import("./layouts.js").Saved|null} layout
 */

const SAID_MS = 1500;
/** The simulator reads no more than a scenario. */
const HARMLESS = "sim:";
const dialog = $("#link-dialog", HTMLDialogElement);

export function setUp() {
  $("#share-button").addEventListener("click", share);
  addEventListener("hashchange", begin);
  begin();
}

/** @returns {string} */
export function link() {
  const state = get("state"), params = get("params"), selection = get("selection");
  const query = new URLSearchParams();
  if (state?.uri) query.set("uri", state.uri);
  query.set("frame", String(get("scrub") ?? state?.index ?? 0));
  if (selection !== null) query.set("select", String(selection));
  if (params) {
    query.set("preset", params.preset);
    const changed = Object.entries(params.values).filter(([name, value]) => value !== params.base[name]);
    if (changed.length) query.set("params", JSON.stringify(Object.fromEntries(changed)));
  }
  query.set("layout", JSON.stringify(layouts.current()));
  return `${location.origin}${location.pathname}#${query}`;
}

/** @param {string} hash @returns {Shared|null} null when it is no link of ours */
export function parse(hash) {
  const query = new URLSearchParams(hash.replace(/^#/, ""));
  if (!query.has("uri") && !query.has("frame")) return null;
  const whole = (/** @type {string} */ name) => (/^\d{1,9}$/.test(query.get(name) ?? "") ? Number(query.get(name)) : null);
  return { uri: query.get("uri"), index: whole("frame"), selection: whole("select"), preset: query.get("preset"), values: object(query.get("params")) ?? {}, layout: object(query.get("layout")) };
}

/** @param {string|null} json @returns {any} */
function object(json) {
  try {
    const value = JSON.parse(json ?? "null");
    return value !== null && typeof value === "object" && !Array.isArray(value) ? value : null;
  } catch {
    return null;
  }
}

export async function share() {
  const address = link();
  try {
    await navigator.clipboard.writeText(address);
    const button = $("#share-button");
    button.textContent = "Copied";
    setTimeout(() => (button.textContent = "Share"), SAID_MS);
  } catch {
    show("Copy this link", address);
  }
}

/** Take a link off the address, and apply it once the state is known. */
function begin() {
  const shared = parse(location.hash);
  if (!shared) return;
  history.replaceState(null, "", location.pathname + location.search);
  if (get("state")) return void apply(shared);
  let isDone = false;
  on(["state"], () => {
    if (isDone) return;
    isDone = true;
    apply(shared);
  });
}

/** @param {Shared} shared */
async function apply(shared) {
  const { uri } = shared;
  if (uri && uri !== get("state")?.uri) return uri.startsWith(HARMLESS) ? open(uri, shared) : ask(uri, shared);
  if (shared.layout) layouts.apply(shared.layout);
  if (shared.preset) {
    const body = { preset: shared.preset, values: shared.values };
    await request("api/params", "POST", body).catch((problem) => show("This link's parameters do not fit", problem.message));
  }
  if (shared.index !== null) {
    playback({ playing: false }); // it leads to a moment, which playing would leave at once
    seekTo(shared.index);
  }
  set("selection", shared.selection);
}

/** A link may come from anywhere: files and devices are opened only when a person says so. @param {string} uri @param {Shared} shared */
function ask(uri, shared) {
  const yes = el("button", { type: "button", textContent: "Open it" });
  yes.addEventListener("click", () => {
    dialog.close();
    open(uri, shared);
  });
  dialog.replaceChildren(el("h2", { textContent: "This link shows another recording" }), el("p", {}, el("code", { textContent: uri })),
    el("form", { class: "dialog-buttons", method: "dialog" }, yes, el("button", { textContent: "Stay here" })));
  dialog.showModal();
}

/** @param {string} uri @param {Shared} shared */
async function open(uri, shared) {
  let isDone = false;
  on(["state"], () => {
    if (isDone || get("state")?.uri !== uri || !get("state")?.frame) return;
    isDone = true;
    apply(shared);
  });
  await request("api/source", "POST", { uri }).catch(() => (isDone = true));
}

/** @param {string} title @param {string} words */
function show(title, words) {
  const field = el("input", { type: "text", value: words, readOnly: true, aria: { label: title } });
  dialog.replaceChildren(el("h2", { textContent: title }), field, el("form", { class: "dialog-buttons", method: "dialog" }, el("button", { textContent: "Close" })));
  dialog.showModal();
  field.select();
}
