/** What is said of the shown frame as a whole: events, tags, the path where the pipeline's is wrong; and what was done to each. */
import { el, keyed, text } from "../dom.js";
import { seekTo } from "../drive/seek.js";
import { get, paint } from "../store.js";
import { act } from "./acts.js";
import { addEvent, tagFrame } from "./commands.js";
import { leadName, shown } from "./held.js";
import { setTool } from "./mode.js";
import { Past } from "./past.js";

/** By the first a person says that every vehicle of the frame is labelled (pipeline/labels/model.py, WHOLE_TAG). */
const TAGS = ["all labelled", "night", "rain", "snow", "fog", "glare", "sensor dirty", "tunnel"];

const list = el("div", { class: "moment-list" }), pasts = el("div", { class: "moment-pasts" }), pastTitle = el("h3", { textContent: "History" });
const word = el("input", { type: "text", maxLength: 40, placeholder: "Tag", aria: { label: "Tag of this frame" } });
const pathWords = el("span", { class: "facts" }), noPath = el("button", { type: "button", textContent: "Take back", onclick: () => act({ kind: "remove_path", frame: shown() }) });

/** @param {HTMLElement} parent */
export function setUp(parent) {
  const known = el("datalist", { id: "known-tags" }, ...TAGS.map((value) => el("option", { value })));
  word.setAttribute("list", "known-tags");
  const form = el("form", { class: "menu-row", onsubmit: tag }, word, el("button", { textContent: "Add" }));
  const event = (/** @type {string} */ kind, /** @type {string} */ words) => el("button", { type: "button", textContent: words, title: "An event of this frame, about the selected track", onclick: () => addEvent(kind) });
  const draw = el("button", { type: "button", textContent: "Draw the path", title: "Drag along the middle of our path in the plan (Shift P)", onclick: () => setTool("path") });
  parent.append(el("h3", { textContent: "This frame" }), el("div", { class: "moment-buttons" }, event("cut_in", "Cut-in"), event("cut_out", "Cut-out"), draw, noPath, pathWords), form, known, list, pastTitle, pasts);
  paint(["labels", "frame", "labeling"], show);
}

/** @param {Event} event */
function tag(event) {
  event.preventDefault();
  if (!word.value.trim()) return;
  tagFrame(word.value.trim(), true);
  word.value = "";
}

/** @typedef {{key: string, frame: number, words: string, drop: () => unknown}} Row */

/** What a second person has said of it. @param {{comment: string, reviewer: string}} label */
const reviewWords = ({ comment, reviewer }) => (comment ? `, sent back: ${comment}` : reviewer ? `, reviewed by ${reviewer}` : "");

function show() {
  const labels = get("labels"), here = shown();
  if (!labels || !get("labeling")?.on) return;
  const path = labels.paths.find(({ frame, state }) => frame === here && state !== "rejected");
  noPath.hidden = !path;
  text(pathWords, path ? `path ${path.state}${reviewWords(path)}` : "");
  /** @type {Row[]} */
  const rows = [
    ...labels.tags.filter(({ frame }) => frame === here).map((each) => ({ key: `tag ${each.id}`, frame: here, words: each.tag, drop: () => tagFrame(each.tag, false) })),
    ...labels.events.filter(({ state }) => state !== "rejected").map((each) => ({
      key: `event ${each.id}`, frame: each.frame, words: `${each.kind.replace("_", "-")} ${each.tracks.map((id) => `#${id}`).join(" ")} · frame ${each.frame + 1}${reviewWords(each)}`,
      drop: () => act({ kind: "remove", items: [{ kind: "event", id: each.id, revision: each.revision }] }),
    })),
  ];
  keyed(list, rows, ({ key }) => key, ({ frame, drop, words }) => el("div", { class: "moment-row" },
    el("button", { type: "button", class: "quiet", onclick: () => seekTo(frame) }), el("button", { type: "button", class: "drop", textContent: "✕", aria: { label: `Remove ${words}` }, onclick: drop })),
  (node, { words }) => text(/** @type {HTMLElement} */ (node.firstElementChild), words));
  showPasts(labels, here);
}

/** @typedef {{kind: import("./types.js").ItemKind, id: number, revision: number, words: string}} Dated */

/** Who leads, path, events and tags of a frame, each with what was done to it. @param {import("./held.js").Labels} labels @param {number} here */
function showPasts(labels, here) {
  /** @type {Dated[]} */
  const found = [
    ...labels.leads.filter(({ first, last }) => first <= here && here <= last).map(({ id, revision, lead, first, last }) => ({ kind: /** @type {const} */ ("lead"), id, revision, words: `lead ${leadName(lead)} · ${first === last ? `frame ${first + 1}` : `frames ${first + 1}–${last + 1}`}` })),
    ...labels.paths.filter(({ frame }) => frame === here).map(({ id, revision, state }) => ({ kind: /** @type {const} */ ("path"), id, revision, words: `path · ${state}` })),
    ...labels.events.filter(({ frame }) => frame === here).map(({ id, revision, kind, state }) => ({ kind: /** @type {const} */ ("event"), id, revision, words: `${kind.replace("_", "-")} · ${state}` })),
    ...labels.tags.filter(({ frame }) => frame === here).map(({ id, revision, tag: words }) => ({ kind: /** @type {const} */ ("tag"), id, revision, words })),
  ];
  pastTitle.hidden = !found.length;
  keyed(pasts, found, ({ kind, id }) => `${kind} ${id}`, createPast, updatePast);
}

/** @type {WeakMap<Element, {past: Past, item: Dated}>} */
const held = new WeakMap();

/** @param {Dated} item */
function createPast(item) {
  const past = new Past(), node = el("details", { data: { kind: item.kind } }, el("summary", {}), past.node);
  held.set(node, { past, item });
  node.addEventListener("toggle", () => lookBack(node));
  return node;
}

/** @param {HTMLDetailsElement} node @param {Dated} item */
function updatePast(node, item) {
  /** @type {{item: Dated}} */ (held.get(node)).item = item;
  text(/** @type {HTMLElement} */ (node.firstElementChild), item.words);
  lookBack(node);
}

/** Its acts, while they are seen. @param {HTMLDetailsElement} node */
function lookBack(node) {
  const { past, item } = /** @type {{past: Past, item: Dated}} */ (held.get(node));
  if (node.open) past.look(item.kind, item.id, item.revision);
}
