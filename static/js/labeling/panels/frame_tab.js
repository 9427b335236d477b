/**
 * Labels of the current frame as a whole: events, tags and the ego path, each with its history.
 */
import { el, keyed, press, text } from "../../core/dom.js";
import { seekTo } from "../../drive/seek.js";
import { get, paint } from "../../core/store.js";
import { act } from "../acts/queue.js";
import { addEvent } from "../acts/commands.js";
import { leadName, shown } from "../state/labels.js";
import { setTool } from "../state/mode.js";
import { Past } from "./history_list.js";
import { span } from "../state/marked_frames.js";
import { isSaid, KNOWN_TAGS, tagFrames, tagsAt, takeBack, toggleWhole, WHOLE_TAG } from "../acts/tags.js";

const list = el("div", { class: "moment-list" }),
  pasts = el("div", { class: "moment-pasts" }),
  pastTitle = el("h3", { textContent: "History" });
const word = el("input", { type: "text", maxLength: 40, placeholder: "Tag", aria: { label: "Tag for these frames" } });
const pathWords = el("span", { class: "facts" }),
  noPath = el("button", {
    type: "button",
    textContent: "Remove path",
    onclick: () => act({ kind: "remove_path", frame: shown() }),
  });

const whole = el("button", {
  type: "button",
  class: "toggle",
  textContent: "All labelled",
  title: "All vehicles are labelled in this frame or the marked frames (Shift W)",
  onclick: toggleWhole,
});
const title = el("h3", {});

/** @param {HTMLElement} parent */
export function setUp(parent) {
  const known = el("datalist", { id: "known-tags" }, ...KNOWN_TAGS.map((value) => el("option", { value })));
  word.setAttribute("list", "known-tags");
  const form = el("form", { class: "menu-row", onsubmit: addTag }, word, el("button", { textContent: "Add" }), whole);
  const event = (/** @type {string} */ kind, /** @type {string} */ words) =>
    el("button", {
      type: "button",
      textContent: words,
      title: "Add an event to this frame for the selected track or the lead",
      onclick: () => addEvent(kind),
    });
  const draw = el("button", {
    type: "button",
    textContent: "Draw path",
    title: "Drag along the path centre in the plan (Shift P)",
    onclick: () => setTool("path"),
  });
  parent.append(
    title,
    el(
      "div",
      { class: "moment-buttons" },
      event("cut_in", "Cut-in"),
      event("cut_out", "Cut-out"),
      draw,
      noPath,
      pathWords,
    ),
    form,
    known,
    list,
    pastTitle,
    pasts,
  );
  paint(["labels", "frame", "labeling", "marked"], show);
}

/** @param {Event} event */
function addTag(event) {
  event.preventDefault();
  if (!word.value.trim()) return;
  tagFrames(word.value.trim(), true);
  word.value = "";
}

/** @typedef {{key: string, frame: number, words: string, drop: () => unknown}} Row */

/** @param {{first: number, last: number}} range */
const framesWords = ({ first, last }) => (first === last ? `frame ${first + 1}` : `frames ${first + 1}–${last + 1}`);

/** Review state. @param {{comment: string, reviewer: string}} label */
const reviewWords = ({ comment, reviewer }) =>
  comment ? `, sent back: ${comment}` : reviewer ? `, reviewed by ${reviewer}` : "";

/** "cut-in #3 #4". @param {import("../state/types.js").EventLabel} event */
const eventWords = ({ kind, tracks }) => [kind.replace("_", "-"), ...tracks.map((id) => `#${id}`)].join(" ");

function show() {
  const labels = get("labels"),
    here = shown();
  if (!labels || !get("labeling")?.on) return;
  const path = labels.paths.find(({ frame, state }) => frame === here && state !== "rejected");
  text(title, get("marked") ? `This frame and marked ${framesWords(span())}` : "This frame");
  press(whole, isSaid(WHOLE_TAG, span()));
  noPath.hidden = !path;
  text(pathWords, path ? `path ${path.state}${reviewWords(path)}` : "");
  /** @type {Row[]} */
  const rows = [
    ...tagsAt(here).map((each) => ({
      key: `tag ${each.id} ${each.revision}`,
      frame: each.first,
      words: `${each.tag} · ${framesWords(each)}`,
      drop: () => takeBack(each),
    })),
    ...labels.events
      .filter(({ state }) => state !== "rejected")
      .map((each) => ({
        key: `event ${each.id}`,
        frame: each.frame,
        words: `${eventWords(each)} · frame ${each.frame + 1}${reviewWords(each)}`,
        drop: () => act({ kind: "remove", items: [{ kind: "event", id: each.id, revision: each.revision }] }),
      })),
  ];
  keyed(
    list,
    rows,
    ({ key }) => key,
    ({ frame, drop, words }) =>
      el(
        "div",
        { class: "moment-row" },
        el("button", { type: "button", class: "quiet", onclick: () => seekTo(frame) }),
        el("button", {
          type: "button",
          class: "drop",
          textContent: "✕",
          aria: { label: `Remove ${words}` },
          onclick: drop,
        }),
      ),
    (node, { words }) => text(/** @type {HTMLElement} */ (node.firstElementChild), words),
  );
  showPasts(labels, here);
}

/** @typedef {{kind: import("../state/types.js").ItemKind, id: number, revision: number, words: string}} Dated */

/**
 * Lead, path, events and tags of a frame, each with its history.
 * @param {import("../state/labels.js").Labels} labels
 * @param {number} here
 */
function showPasts(labels, here) {
  /** @type {Dated[]} */
  const found = [
    ...labels.leads
      .filter(({ first, last }) => first <= here && here <= last)
      .map(({ id, revision, lead, first, last }) => ({
        kind: /** @type {const} */ ("lead"),
        id,
        revision,
        words: `lead ${leadName(lead)} · ${framesWords({ first, last })}`,
      })),
    ...labels.paths
      .filter(({ frame }) => frame === here)
      .map(({ id, revision, state }) => ({
        kind: /** @type {const} */ ("path"),
        id,
        revision,
        words: `path · ${state}`,
      })),
    ...labels.events
      .filter(({ frame }) => frame === here)
      .map(({ id, revision, kind, state }) => ({
        kind: /** @type {const} */ ("event"),
        id,
        revision,
        words: `${kind.replace("_", "-")} · ${state}`,
      })),
    ...tagsAt(here).map((each) => ({
      kind: /** @type {const} */ ("tag"),
      id: each.id,
      revision: each.revision,
      words: `${each.tag} · ${framesWords(each)}`,
    })),
  ];
  pastTitle.hidden = !found.length;
  keyed(pasts, found, ({ kind, id }) => `${kind} ${id}`, createPast, updatePast);
}

/** @type {WeakMap<Element, {past: Past, item: Dated}>} */
const held = new WeakMap();

/** @param {Dated} item */
function createPast(item) {
  const past = new Past(),
    node = el("details", { data: { kind: item.kind } }, el("summary", {}), past.node);
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

/** Load the history while it is open. @param {HTMLDetailsElement} node */
function lookBack(node) {
  const { past, item } = /** @type {{past: Past, item: Dated}} */ (held.get(node));
  if (node.open) past.look(item.kind, item.id, item.revision);
}
