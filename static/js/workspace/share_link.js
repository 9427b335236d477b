/**
 * Links to the current view: recording, frame, selection, parameters, layout. Stored in the URL hash, which is not sent
 * to servers. A link is applied once and then removed from the URL, so that a reload does not go back.
 */
import { playback, request } from "../core/api.js";
import { $, el, text } from "../core/dom.js";
import { seekTo } from "../drive/seek.js";
import { refused } from "../panels/notices.js";
import { get, on, set } from "../core/store.js";
import * as layouts from "./layouts.js";

/** @typedef {import("../core/types.js").ParamValue} ParamValue */
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
/** Built-in simulations, which read no files. */
const BUILT_IN = /^sim:\w+$/;
const dialog = $("#link-dialog", HTMLDialogElement);

export function setUp() {
  $("#share-button").addEventListener("click", share);
  addEventListener("hashchange", begin);
  begin();
}

/** @returns {string} */
export function link() {
  const state = get("state"),
    params = get("params"),
    selection = get("selection");
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

/** @param {string} hash @returns {Shared|null} null if it is not a shared link */
export function parse(hash) {
  const query = new URLSearchParams(hash.replace(/^#/, ""));
  if (!query.has("uri") && !query.has("frame")) return null;
  const whole = (/** @type {string} */ name) =>
    /^\d{1,9}$/.test(query.get(name) ?? "") ? Number(query.get(name)) : null;
  return {
    uri: query.get("uri"),
    index: whole("frame"),
    selection: whole("select"),
    preset: query.get("preset"),
    values: object(query.get("params")) ?? {},
    layout: layouts.checked(object(query.get("layout"))),
  };
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
    sayCopied(true);
    setTimeout(() => sayCopied(false), SAID_MS);
  } catch {
    show("Copy this link", address);
  }
}

/** @param {boolean} isCopied */
function sayCopied(isCopied) {
  for (const button of document.querySelectorAll(".share")) button.classList.toggle("is-other", isCopied);
  text($("#announcement"), isCopied ? "Link copied" : "");
}

/** Remove a link from the URL, and apply it once the state is known. */
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

/**
 * Links are untrusted: changes that affect others need the user's consent.
 * @param {Shared} shared
 * @param {boolean} [agreed]
 */
async function apply(shared, agreed = false) {
  const { uri } = shared;
  const changes = agreed ? [] : await whatItChanges(shared);
  if (changes.length) return ask(changes, shared);
  if (uri && uri !== get("state")?.uri) return open(uri, shared);
  if (shared.layout) layouts.apply(shared.layout);
  if (shared.preset) {
    const body = { preset: shared.preset, values: shared.values };
    await request("api/params", "POST", body).catch((problem) =>
      show("This link has invalid parameters", problem.message),
    );
  }
  if (shared.index !== null && !get("state")?.live) {
    playback({ playing: false }); // pause, or playback would leave the linked frame at once
    seekTo(shared.index);
  }
  set("selection", shared.selection);
}

/**
 * Open a moment that was chosen on this page. Only what would end live driving is asked about.
 * @param {string} uri @param {number} index
 */
export function goTo(uri, index) {
  const state = get("state");
  apply({ uri, index, selection: null, preset: null, values: {}, layout: null }, !state?.live && !state?.recording);
}

/** Describe what the link would change beyond this page. @param {Shared} shared @returns {Promise<string[]>} */
async function whatItChanges(shared) {
  const state = get("state"),
    changes = [];
  const opens = shared.uri && shared.uri !== state?.uri;
  if (opens && !BUILT_IN.test(shared.uri ?? "")) changes.push(`open ${shared.uri}`);
  if (opens && state?.live) changes.push("disconnect the live sensors");
  if (opens && state?.recording) changes.push("stop recording");
  if (shared.preset) {
    /** @type {{preset: string, values: Record<string, ParamValue>, base: Record<string, ParamValue>}} */
    const now = await request("api/params");
    const wanted = { ...now.base, ...shared.values };
    const differing = Object.keys(wanted).filter((name) => wanted[name] !== now.values[name]);
    if (shared.preset !== now.preset) changes.push(`use preset ${shared.preset}`);
    else if (differing.length) changes.push(`change ${differing.join(", ")}`);
  }
  return changes;
}

/** @param {string[]} changes @param {Shared} shared */
function ask(changes, shared) {
  const yes = el("button", { type: "button", textContent: "Continue" });
  yes.addEventListener("click", () => {
    dialog.close();
    apply(shared, true);
  });
  dialog.replaceChildren(
    el("h2", { textContent: "This link will" }),
    el("ul", {}, ...changes.map((words) => el("li", {}, el("code", { textContent: words })))),
    el("form", { class: "dialog-buttons", method: "dialog" }, yes, el("button", { textContent: "Cancel" })),
  );
  dialog.showModal();
}

/** @param {string} uri @param {Shared} shared */
async function open(uri, shared) {
  let isDone = false;
  on(["state"], () => {
    if (isDone || get("state")?.uri !== uri || !get("state")?.frame) return;
    isDone = true;
    apply(shared, true);
  });
  await request("api/source", "POST", { uri }).catch((problem) => {
    isDone = true;
    refused(problem);
  });
}

/** @param {string} title @param {string} words */
function show(title, words) {
  const field = el("input", { type: "text", value: words, readOnly: true, aria: { label: title } });
  dialog.replaceChildren(
    el("h2", { textContent: title }),
    field,
    el("form", { class: "dialog-buttons", method: "dialog" }, el("button", { textContent: "Close" })),
  );
  dialog.showModal();
  field.select();
}
