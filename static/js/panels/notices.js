/**
 * Notices: missing detector, degraded frames, lost connection, refused requests. Errors have a row each. All others
 * share one row of one line, which opens into a list: what a frame says comes and goes, and must not move the page.
 */
import { Refused } from "../core/api.js";
import { $, el, mark, text } from "../core/dom.js";
import { get, on } from "../core/store.js";

/** @typedef {import("../core/types.js").Notice & {fixed?: boolean, ofFrame?: boolean}} Shown
 *   fixed: cannot be dismissed */

/** @type {Set<string>} */
const dismissed = new Set();
/** After how long without a new frame live data is called old. */
const OLD_MS = 2000;
/** How long a refusal is shown. */
const REFUSAL_MS = 10_000;
/** How long a note of a frame stays while frames go by: one frame is too short to read. */
const HOLD_MS = 1500;
let shown = "";
/** @type {{words: string, until: number}|null} */
let refusal = null;
/** Notes of frames, with the time until which they are shown. @type {Map<string, number>} */
const held = new Map();
/** The source whose frames had notes: their row stays, so that the next one does not move the page. */
let noted = "";
let isOpen = false;
/** Whether only the beginning of the shared row's text is seen while it is closed. */
let isCut = false;
/** The newest frame, by when it was made, and when it came, in the page's own monotonic time. */
const newest = { madeUnixMs: -1, at: 0 };

const errors = el("div"),
  level = el("b"),
  words = el("span"),
  more = el("button", { type: "button", class: "more", title: "Show or hide the rest", onclick: toggle }),
  dismiss = el("button", { type: "button", textContent: "✕", aria: { label: "Dismiss" }, onclick: dismissFirst }),
  row = el("div", { class: "notice one-line", hidden: true }, level, words, more, dismiss),
  rest = el("div");
/** What the shared row has. @type {Shown[]} */
let calm = [];

export function setUp() {
  $("#notices").append(errors, row, rest);
  on(["state", "frame", "link"], update);
  setInterval(measure, 1000); // not with every frame: it makes the browser lay out the page
  new ResizeObserver(measure).observe(words);
}

/**
 * Show a refused request. Connection loss has a notice of its own.
 * @param {unknown} error
 */
export function refused(error) {
  if (error instanceof Refused) briefly(error.message);
}

/** Show for a few seconds why something that was asked for was not done. @param {string} words */
export function briefly(words) {
  refusal = { words, until: Date.now() + REFUSAL_MS };
  dismissed.delete(words);
  update();
}

function measure() {
  if (!isOpen) isCut = words.scrollWidth > words.clientWidth;
  update();
}

function update() {
  const link = get("link");
  document.documentElement.dataset.link = link?.status ?? "connecting";
  const states = { live: "connected", lost: "connection lost", connecting: "connecting" };
  text($("#link"), states[link?.status ?? "connecting"]);
  const busy = get("state")?.busy;
  $("#busy").hidden = !busy;
  document.documentElement.toggleAttribute("data-busy", Boolean(busy)); // other panes show outdated content
  text($("#busy"), busy ?? "");
  const notices = [...lost(link), ...silence(), ...ofHand(), ...standing(), ...ofFrames()].filter(
    (each) => !dismissed.has(kindOf(each)),
  );
  calm = ["warning", "info"].flatMap((one) => notices.filter((each) => each.level === one));
  const key = JSON.stringify([notices, isOpen, isCut, noted]);
  if (key === shown) return;
  shown = key;
  errors.replaceChildren(...notices.filter((each) => each.level === "error").map(notice));
  showCalm();
}

function showCalm() {
  const [first = null, ...others] = calm;
  if (!others.length && !isCut) isOpen = false;
  row.hidden = !first && !noted;
  mark(row, "level", first?.level ?? "none");
  text(level, first?.level ?? "");
  text(words, first?.text ?? "no notes on this frame");
  words.title = first?.text ?? "";
  row.classList.toggle("is-open", isOpen);
  more.hidden = !others.length && !isCut;
  text(more, isOpen ? "Show less" : others.length ? `+${others.length} more` : isCut ? "Show all" : "");
  more.setAttribute("aria-expanded", String(isOpen));
  rest.replaceChildren(...(isOpen ? others.map(notice) : []));
}

function toggle() {
  isOpen = !isOpen;
  update();
}

function dismissFirst() {
  if (calm.length) dismissed.add(kindOf(calm[0]));
  if (calm.length <= 1) noted = "";
  update();
}

/** Notes of frames differ in their numbers: dismissed once, they stay away. @type {(each: Shown) => string} */
const kindOf = ({ text: said, ofFrame }) => (ofFrame ? said.replace(/[\d.]+/g, "#") : said);

/** @param {{status: string, since: number}|null} link @returns {Shown[]} */
function lost(link) {
  if (link?.status !== "lost") return [];
  const seconds = Math.round((Date.now() - link.since) / 1000);
  return [
    {
      level: "error",
      text: `Connection lost ${seconds} s ago. The view is out of date; reconnecting.`,
      fixed: true,
    },
  ];
}

/** Live sensors that send nothing: what is shown must not look fresh. @returns {Shown[]} */
function silence() {
  const state = get("state"),
    frame = get("frame"),
    now = performance.now();
  const isFollowing = state?.live && state.playing && !state.busy && frame?.state.uri === state.uri;
  if (!isFollowing || frame.madeUnixMs !== newest.madeUnixMs) newest.at = now;
  newest.madeUnixMs = frame?.madeUnixMs ?? -1;
  const old = now - newest.at;
  document.documentElement.toggleAttribute("data-old", old > OLD_MS);
  if (old <= OLD_MS || get("link")?.status === "lost") return [];
  const words = `No new data for ${Math.floor(old / 1000)} s. The view is out of date.`;
  return [{ level: "error", text: words, fixed: true }];
}

/** @returns {Shown[]} */
function ofHand() {
  if (refusal && refusal.until < Date.now()) refusal = null;
  return refusal ? [{ level: "error", text: refusal.words }] : [];
}

/** Notices about the whole recording; information is merged into one. @returns {Shown[]} */
function standing() {
  const notices = get("state")?.notices ?? [];
  const infos = notices.filter((each) => each.level === "info").map((each) => each.text);
  const others = notices.filter((each) => each.level !== "info");
  return infos.length ? [...others, { level: "info", text: infos.join(" · ") }] : others;
}

/** Notes of the current frame and, while frames go by, of those just before it. @returns {Shown[]} */
function ofFrames() {
  const state = get("state"),
    now = Date.now(),
    notes = get("frame")?.result.notes ?? [];
  if (noted !== "" && state && noted !== state.uri) noted = "";
  for (const [said, until] of held) if (!state?.playing || until < now) held.delete(said);
  for (const said of notes) {
    held.set(said, now + HOLD_MS);
    if (!dismissed.has(kindOf({ level: "warning", text: said, ofFrame: true }))) noted = state?.uri ?? "";
  }
  return [...held.keys()].map((said) => ({ level: "warning", text: said, ofFrame: true }));
}

/** @param {Shown} each */
function notice(each) {
  const close = () => {
    dismissed.add(kindOf(each));
    update();
  };
  return el(
    "div",
    { class: "notice", data: { level: each.level } },
    el("b", { textContent: each.level }),
    el("span", { textContent: each.text }),
    each.fixed ? null : el("button", { type: "button", textContent: "✕", aria: { label: "Dismiss" }, onclick: close }),
  );
}
