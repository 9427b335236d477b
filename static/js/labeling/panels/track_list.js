/** The list of labelled tracks: state, class, frames, author. */
import { el, press, text, within } from "../../core/dom.js";
import { percent } from "../../core/format.js";
import { LongList } from "../../core/long_list.js";
import { get, paintAfter } from "../../core/store.js";
import { mergeWith, propose, rejectHidden, select } from "../acts/commands.js";
import { listThe, listed, which } from "../state/listed.js";
import { isKnown } from "../state/sightings.js";
import { isSentBack, shown, stateWords, trackOf } from "../state/labels.js";
import { parted, setThreshold, threshold } from "../state/threshold.js";

/** @typedef {import("../state/types.js").LabelTrack} LabelTrack */
/** @typedef {import("../state/listed.js").Which} Which */

/** Maximum number of rows. */
const MOST = 100;
const WHICH = /** @type {[Which, string, string][]} */ ([
  ["here", "Here", "Labels in this frame"],
  ["open", "To do", "Proposed or sent back; in review: not yet reviewed"],
  ["all", "All", "All tracks in the drive"],
]);

const body = el("div", { class: "track-list", tabIndex: -1, aria: { role: "listbox", label: "Tracks" } });
const nothing = el("p", { class: "facts pad", hidden: true });
const begin = el("button", {
  type: "button",
  class: "begin",
  textContent: "Propose",
  title: "Propose labels from the pipeline (P)",
  hidden: true,
  onclick: propose,
});
const count = el("span", { class: "facts" });
const slider = el("input", {
    type: "range",
    min: "0",
    max: "1",
    step: "0.05",
    title: "Proposals below this confidence are hidden",
    aria: { label: "Minimum confidence of proposals" },
  }),
  above = el("span", { class: "facts above" }),
  reject = el("button", {
    type: "button",
    textContent: "Reject hidden",
    title: "Reject all proposals below the slider, in the whole drive",
    onclick: rejectHidden,
  }),
  sureness = el("div", { class: "list-bar sureness", hidden: true }, slider, above, reject);
const list = new LongList(body, (/** @type {LabelTrack} */ { id }) => id, create, update);
/** The selected track that was brought into view. @type {number|null} */
let scrolledTo = null;

/** @param {HTMLElement} parent */
export function setUp(parent) {
  const buttons = WHICH.map(([key, words, title]) =>
    el("button", { type: "button", textContent: words, title, data: { which: key }, onclick: () => choose(key) }),
  );
  parent.append(
    el(
      "div",
      { class: "list-bar" },
      el("div", { class: "joined", aria: { role: "group", label: "Tracks to list" } }, ...buttons),
      el("span", { class: "spacer" }),
      count,
    ),
    sureness,
    body,
  );
  slider.addEventListener("input", () => setThreshold(slider.valueAsNumber));
  body.append(nothing, begin);
  new ResizeObserver(bringIntoView).observe(body);
  body.addEventListener("click", (event) => pick(within(event, ".track-row")));
  const reflect = paintAfter(
    ["labels", "labelFrames", "frame", "track", "labeling", "draft", "threshold", "state"],
    show,
  );
  body.addEventListener("settle", reflect);
  /** @param {Which} key */
  function choose(key) {
    listThe(key);
    list.settle();
    reflect();
  }
  /** Redraw the list. */
  function show() {
    if (!get("labeling")?.on) return;
    for (const button of buttons) press(button, button.dataset.which === which());
    showSureness();
    if (which() === "here" && !isKnown(shown())) return;
    const found = listed();
    text(count, found.length > MOST ? `${MOST} of ${found.length}` : String(found.length));
    list.show(found.slice(0, MOST));
    for (const row of body.querySelectorAll("[aria-selected=true]")) markSelected(/** @type {HTMLElement} */ (row));
    if (get("track") !== scrolledTo) bringIntoView();
    scrolledTo = get("track") ?? null;
    nothing.hidden = found.length > 0;
    text(nothing, emptyWords());
    begin.hidden = (get("labels")?.tracks.size ?? 0) > 0 || proposing() !== null;
  }
}

/** The selected row; again when the details below it take its place. Out of sight, it does not know yet that it is. */
function bringIntoView() {
  list.rowOf(get("track") ?? -1)?.scrollIntoView({ block: "nearest" });
}

/** Also of a row out of sight, which is otherwise drawn later. @param {HTMLElement} row */
function markSelected(row) {
  row.setAttribute("aria-selected", String(Number(row.dataset.id) === get("track")));
}

/** The threshold and what it leaves, while there are proposals it applies to. */
function showSureness() {
  const { shown: left, hidden } = parted();
  if (!list.isHeld) sureness.hidden = !left.length && !hidden.length; // it would move the rows
  reject.disabled = !hidden.length; // without it, the bar would be lower
  slider.value = String(threshold());
  text(above, `≥ ${percent(threshold())}: ${left.length} proposed, ${hidden.length} hidden`);
}

/** The proposals being made now, which a second press would only repeat; else null. */
function proposing() {
  const task = get("state")?.labels?.task ?? null;
  return task?.running && task.what === "propose" ? task : null;
}

function emptyWords() {
  const task = proposing();
  if (task) return `Proposing labels: ${task.done} of ${task.total} …`;
  if (!get("labels")?.tracks.size) return "No labels yet. Propose labels from the pipeline (P), or draw one (G).";
  return which() === "open" ? "Nothing left to do." : "No labels in this frame.";
}

function create() {
  const part = (/** @type {string} */ name) => el("span", { class: name });
  return el(
    "button",
    { type: "button", class: "track-row", aria: { role: "option" } },
    part("mark"),
    el("b"),
    part("what"),
    part("frames"),
    part("who"),
  );
}

/** @param {HTMLElement} row @param {LabelTrack} item outdated if it has left the list */
function update(row, item) {
  const track = trackOf(item.id) ?? item,
    { id, label, state, first, last, keyframes, origin, comment, reviewer, confidence } = track;
  markSelected(row);
  row.dataset.state = isSentBack(track) ? "sent-back" : state;
  const [mark, name, what, frames, who] = [...row.children];
  text(name, `#${id}`);
  text(
    mark,
    reviewer
      ? "✓✓"
      : isSentBack(track)
        ? "↩"
        : { proposed: "?", accepted: "✓", corrected: "✎", rejected: "✕" }[state],
  );
  mark.setAttribute("aria-label", stateWords(track));
  text(what, label);
  text(
    frames,
    first === null || last === null
      ? "no frames"
      : `${first + 1}–${last + 1}${keyframes.length ? ` · ${keyframes.length} key` : ""}`,
  );
  const sure = state === "proposed" && confidence !== null ? percent(confidence) : null;
  text(who, reviewer || (origin.maker === "person" ? origin.name : (sure ?? origin.maker)));
  const made = `made by ${origin.name || origin.maker}${reviewer ? `, reviewed by ${reviewer}` : ""}`;
  row.title = [`${state}${comment ? `, sent back: ${comment}` : ""}`, made, origin.how].filter(Boolean).join("; ");
}

/** @param {HTMLElement|null} row */
function pick(row) {
  const track = trackOf(Number(row?.dataset.id ?? -1));
  if (!track) return;
  if (get("labeling")?.tool === "merge") return mergeWith(track.id);
  select(track);
}
