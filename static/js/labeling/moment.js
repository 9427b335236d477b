/** What is said of the shown frame as a whole: events, tags, and the path where the pipeline's is wrong. */
import { el, keyed, text } from "../dom.js";
import { seekTo } from "../drive/seek.js";
import { get, paint } from "../store.js";
import { act } from "./acts.js";
import { addEvent, tagFrame } from "./commands.js";
import { shown } from "./held.js";
import { setTool } from "./mode.js";

/** By the first a person says that every vehicle of the frame is labelled (pipeline/labels/model.py, WHOLE_TAG). */
const TAGS = ["all labelled", "night", "rain", "snow", "fog", "glare", "sensor dirty", "tunnel"];

const list = el("div", { class: "moment-list" });
const word = el("input", { type: "text", maxLength: 40, placeholder: "Tag", aria: { label: "Tag of this frame" } });
const pathWords = el("span", { class: "facts" }), noPath = el("button", { type: "button", textContent: "Take back", onclick: () => act({ kind: "remove_path", frame: shown() }) });

/** @param {HTMLElement} parent */
export function setUp(parent) {
  const known = el("datalist", { id: "known-tags" }, ...TAGS.map((value) => el("option", { value })));
  word.setAttribute("list", "known-tags");
  const form = el("form", { class: "menu-row", onsubmit: tag }, word, el("button", { textContent: "Add" }));
  const event = (/** @type {string} */ kind, /** @type {string} */ words) => el("button", { type: "button", textContent: words, title: "An event of this frame, about the selected track", onclick: () => addEvent(kind) });
  const draw = el("button", { type: "button", textContent: "Draw the path", title: "Drag along the middle of our path in the plan (Shift P)", onclick: () => setTool("path") });
  parent.append(el("h3", { textContent: "This frame" }), el("div", { class: "moment-buttons" }, event("cut_in", "Cut-in"), event("cut_out", "Cut-out"), draw, noPath, pathWords), form, known, list);
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

function show() {
  const labels = get("labels"), here = shown();
  if (!labels || !get("labeling")?.on) return;
  const path = labels.paths.find(({ frame, state }) => frame === here && state !== "rejected");
  noPath.hidden = !path;
  text(pathWords, path ? `path ${path.state}` : "");
  /** @type {Row[]} */
  const rows = [
    ...labels.tags.filter(({ frame }) => frame === here).map((each) => ({ key: `tag ${each.id}`, frame: here, words: each.tag, drop: () => tagFrame(each.tag, false) })),
    ...labels.events.filter(({ state }) => state !== "rejected").map((each) => ({
      key: `event ${each.id}`, frame: each.frame, words: `${each.kind.replace("_", "-")} ${each.tracks.map((id) => `#${id}`).join(" ")} · frame ${each.frame + 1}`,
      drop: () => act({ kind: "remove", items: [{ kind: "event", id: each.id, revision: each.revision }] }),
    })),
  ];
  keyed(list, rows, ({ key }) => key, ({ frame, drop, words }) => el("div", { class: "moment-row" },
    el("button", { type: "button", class: "quiet", onclick: () => seekTo(frame) }), el("button", { type: "button", class: "drop", textContent: "✕", aria: { label: `Remove ${words}` }, onclick: drop })),
  (node, { words }) => text(/** @type {HTMLElement} */ (node.firstElementChild), words));
}
