/** Notices: missing detector, degraded frames, lost connection, refused requests. */
import { Refused } from "../core/api.js";
import { $, el, text } from "../core/dom.js";
import { get, on } from "../core/store.js";

/** @typedef {import("../core/types.js").Notice & {fixed?: boolean}} Shown  fixed: cannot be dismissed */

/** @type {Set<string>} */
const dismissed = new Set();
/** How long a refusal is shown. */
const REFUSAL_MS = 10_000;
let shown = "";
/** @type {{words: string, until: number}|null} */
let refusal = null;

export function setUp() {
  on(["state", "frame", "link"], update);
  setInterval(update, 1000);
}

/**
 * Show a refused request. Connection loss has a notice of its own.
 * @param {unknown} error
 */
export function refused(error) {
  if (!(error instanceof Refused)) return;
  refusal = { words: error.message, until: Date.now() + REFUSAL_MS };
  dismissed.delete(error.message);
  update();
}

function update() {
  const link = get("link");
  document.documentElement.dataset.link = link?.status ?? "connecting";
  const words = { live: "connected", lost: "connection lost", connecting: "connecting" };
  text($("#link"), words[link?.status ?? "connecting"]);
  const busy = get("state")?.busy;
  $("#busy").hidden = !busy;
  document.documentElement.toggleAttribute("data-busy", Boolean(busy)); // other panes show outdated content
  text($("#busy"), busy ?? "");
  const notices = [...lost(link), ...ofHand(), ...standing(), ...ofFrame()].filter(
    ({ text: words }) => !dismissed.has(words),
  );
  const key = JSON.stringify(notices);
  if (key === shown) return;
  shown = key;
  $("#notices").replaceChildren(...notices.map(notice));
}

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

/** @returns {Shown[]} */
function ofHand() {
  if (refusal && refusal.until < Date.now()) refusal = null;
  return refusal ? [{ level: "error", text: refusal.words }] : [];
}

/** Notices about the whole recording; information is merged into one line. @returns {Shown[]} */
function standing() {
  const notices = get("state")?.notices ?? [];
  const infos = notices.filter(({ level }) => level === "info").map(({ text: words }) => words);
  const rest = notices.filter(({ level }) => level !== "info");
  return infos.length ? [...rest, { level: "info", text: infos.join(" · ") }] : rest;
}

/** Notes of the current frame; one that is dismissed stays away in other frames too. @returns {Shown[]} */
function ofFrame() {
  return (get("frame")?.result.notes ?? []).map((words) => ({ level: "warning", text: words }));
}

/** @param {Shown} notice */
function notice({ level, text: words, fixed }) {
  const close = () => {
    dismissed.add(words);
    update();
  };
  return el(
    "div",
    { class: "notice", data: { level } },
    el("b", { textContent: level }),
    el("span", { textContent: words }),
    fixed ? null : el("button", { type: "button", textContent: "✕", aria: { label: "Dismiss" }, onclick: close }),
  );
}
