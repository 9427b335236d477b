/** What in the labels can hardly be so; a press goes there. Looked for again after each act, while it is seen. */
import { newestOnly, request } from "../../core/api.js";
import { $, el, text } from "../../core/dom.js";
import { seekTo } from "../../drive/seek.js";
import { get, on, set } from "../../core/store.js";

/** @typedef {import("../state/types.js").Problem} Problem */

/** Rows shown; the rest are counted. */
const MOST = 200;
/** @type {HTMLElement|null} */
let body = null;
let known = "";

export const look = newestOnly(async () => {
  const state = get("state"),
    key = `${state?.uri} ${state?.labels?.revision}`;
  if (!body || !isSeen() || !state?.labels || key === known) return;
  if (!known) body.replaceChildren(el("p", { class: "facts pad", textContent: "Checking …" }));
  /** @type {{revision: number, problems: Problem[]}|Error} */
  const found = await request("api/labels/checks").catch((error) => error);
  known = found instanceof Error ? "" : key;
  if (found instanceof Error) return body.replaceChildren(el("p", { class: "facts pad", textContent: found.message }));
  text($("#tab-label-checks"), found.problems.length ? `Checks ${found.problems.length}` : "Checks");
  body.replaceChildren(
    el("p", { class: "facts pad", textContent: words(found.problems.length) }),
    ...found.problems.slice(0, MOST).map(row),
  );
});

const isSeen = () => get("labeling")?.on === true && body !== null && !body.hidden;

/** @param {HTMLElement} parent */
export function setUp(parent) {
  body = parent;
  on(["state", "labels"], () => isSeen() && look(undefined));
}

/** Whether anything is labelled: neither proposals nor rejected labels are checked. */
function hasLabels() {
  const labels = get("labels");
  const every = labels ? [...labels.tracks.values(), ...labels.leads] : [];
  return every.some(({ state }) => state !== "proposed" && state !== "rejected");
}

/** @param {number} count */
function words(count) {
  if (!count && !hasLabels()) return "Nothing to check yet: proposals are not checked.";
  if (!count) return "No problems found: no jumps, overlaps, empty cuboids, misplaced boxes or leads without a track.";
  return count > MOST ? `${count} to check, the first ${MOST}:` : `${count} to check:`;
}

/** @param {Problem} problem */
const row = ({ frame, track, words: said }) =>
  el(
    "button",
    {
      type: "button",
      class: "quiet check-row",
      onclick: () => {
        set("track", track);
        seekTo(frame);
      },
    },
    el("b", { textContent: String(frame + 1) }),
    ` ${said}`,
  );
