/**
 * Explains the selected object, or else the CIPV: for the CIPV the ranking of all candidates, for others the gate that
 * rejected them.
 */
import { cipvId, roleOf } from "../core/colors.js";
import { $, el, keyed, mark, text, within } from "../core/dom.js";
import { DASH, num } from "../core/format.js";
import { LongList } from "../core/long_list.js";
import { get, paintAfter, set } from "../core/store.js";
import { oneTabStop } from "../keys/one_tab_stop.js";
import { gateRow, kindOf, quantity, showGate } from "./gate_rows.js";

/** @typedef {import("../core/types.js").Gate} Gate */
/** @typedef {import("../core/types.js").Ranked} Ranked */
/** @typedef {import("../core/types.js").Result} Result */

const number = el("b", { class: "id" }),
  source = el("span", { class: "pill" }),
  lead = el("span", { class: "pill cipv", textContent: "CIPV" });
const type = el("span"),
  verdict = el("p", { class: "verdict", aria: { live: "polite" } });
const gates = el("div", { class: "gates" }),
  ranking = el("div", { class: "ranking" });
const candidates = new LongList(ranking, (/** @type {Ranked} */ { id }) => id, rankedRow, showRanked),
  keepTabStop = oneTabStop(ranking, ".ranked");
const rankingTitle = el("h3", { textContent: "Candidate ranking" });
const content = el(
  "div",
  { class: "why-content" },
  el("div", { class: "line" }, number, source, lead, type),
  verdict,
  gates,
  rankingTitle,
  ranking,
);
const nothing = el("p", { class: "facts pad", textContent: "No frame yet." });

export function setUp() {
  content.hidden = true;
  $("#why").append(nothing, content);
  ranking.addEventListener("click", (event) => pick(within(event, ".ranked")));
  paintAfter(["frame", "selection"], update);
}

function update() {
  const frame = get("frame");
  if (!frame) return;
  const { result, display } = frame;
  const id = get("selection") ?? result.cipv?.id ?? null;
  const item = result.objects.find((each) => each.id === id);
  const isLead = id !== null && result.cipv?.id === id;
  content.hidden = !item;
  nothing.hidden = Boolean(item);
  text($("#why-facts"), item ? (isLead ? "this is the CIPV" : "this is not the CIPV") : "");
  text(
    nothing,
    id === null
      ? "No CIPV in this frame. Select an object to see why it was rejected."
      : `#${id} is not in this frame.`,
  );
  const ranked = display.ranking ?? [];
  const list = isLead || !item ? ranked : [];
  rankingTitle.hidden = list.length === 0;
  if (!item) content.hidden = list.length === 0;
  candidates.show(list);
  keepTabStop();
  if (!item) return void hideObject(true);
  hideObject(false);
  text(number, `#${item.id}`);
  text(source, item.source);
  mark(source, "role", roleOf(item, null));
  lead.hidden = !isLead;
  text(type, `${item.type ?? "obstacle"}${item.distance_m === null ? "" : ` at ${num(item.distance_m)} m`}`);
  text(
    verdict,
    sentence(
      result,
      ranked.find((each) => each.id === id),
      item.id,
      isLead,
    ),
  );
  keyed(gates, failedFirst(item.gates), (gate) => gate.name, gateRow, showGate);
}

/** Failed gates first, so that they are visible without scrolling. @param {Gate[]} all */
const failedFirst = (all) => [...all].sort((a, b) => Number(a.passed) - Number(b.passed));

/** @param {boolean} hidden */
function hideObject(hidden) {
  for (const node of [number.parentElement, verdict, gates]) if (node) node.hidden = hidden;
}

/**
 * The reason, with value and limit of the failed gate.
 * @param {Result} result
 * @param {Ranked|undefined} ranked
 * @param {number} id
 * @param {boolean} isLead
 */
function sentence({ cipv, rejected }, ranked, id, isLead) {
  if (isLead) return cipv?.reason ?? "";
  const reason = ranked?.reason ?? rejected.find((each) => each.id === id)?.reason ?? "";
  if (!ranked?.stopped_by || ranked.stopped_by === "behind") return `Not the CIPV: ${reason}.`;
  return `Not the CIPV: ${reason}${measured(ranked)}.`;
}

/**
 * @param {Ranked} ranked
 * @returns {string} " (off the path's middle 2.31 m, limit 1.5 m)"; empty where the reason has the number
 */
function measured({ stopped_by, value, limit }) {
  const kind = kindOf(stopped_by ?? "");
  if (value === null || limit === null || kind.test !== "most") return "";
  return ` (${kind.label.toLowerCase()} ${quantity(value, kind)}, limit ${quantity(limit, kind)})`;
}

function rankedRow() {
  return el(
    "button",
    { type: "button", class: "ranked" },
    el("span", { class: "order" }),
    el("b"),
    el("span", { class: "far" }),
    el("span", { class: "what" }),
  );
}

/** @param {HTMLElement} row @param {Ranked} ranked */
function showRanked(row, { id, order, distance_m, stopped_by, reason }) {
  const [place, name, far, what] = row.children;
  row.title = `Select #${id}${reason ? `: ${reason}` : ""}`;
  text(place, stopped_by && stopped_by !== "behind" ? "✕" : String(order));
  text(name, `#${id}`);
  text(far, distance_m === null ? DASH : `${num(distance_m)} m`);
  text(what, id === cipvId() ? "the CIPV" : reason);
  mark(row, "passed", stopped_by && stopped_by !== "behind" ? "no" : "yes");
  row.setAttribute("aria-current", String(id === get("selection")));
}

/** @param {HTMLElement|null} row */
function pick(row) {
  if (row) set("selection", Number(row.dataset.id));
}
