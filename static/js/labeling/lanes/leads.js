/**
 * The labelled lead of each frame. A drag along it marks frames, or moves the end of a range; a click selects the
 * track.
 */
import { ui } from "../../core/colors.js";
import { DASH } from "../../core/format.js";
import { get, set } from "../../core/store.js";
import { colorOf } from "../../timeline/lanes/lead_ribbon.js";
import { dragEnd, endAt } from "../acts/range_ends.js";
import { leadAt, leadName } from "../state/labels.js";
import { paint, span as marked } from "../state/marked_frames.js";
import { dragMarks } from "./marking.js";
import { topTagKey } from "./tags.js";

/** @typedef {import("../../timeline/span.js").Span} Span */
/** @typedef {import("../../timeline/rows.js").Row} Row */
/** @typedef {import("../state/types.js").LeadRange} LeadRange */

const NAME_FROM_PX = 22,
  HATCH_PX = 5;
const FONT = '600 10.5px system-ui, "DejaVu Sans", sans-serif';

/** @type {import("../../timeline/lanes/registry.js").Lane} */
export const leads = {
  key: "label-leads",
  height: () => (get("labeling")?.on ? 18 : 0),
  redrawOn: ["labeling", "labels"],
  frontOn: ["marked", "trimmed"],
  draw(ctx, { span, row, isLight }) {
    ctx.fillStyle = ui("raised");
    ctx.fillRect(span.left, row.top, span.width, row.height);
    for (const range of get("labels")?.leads ?? []) {
      if (range.state === "rejected" || range.last < span.first || range.first > span.end) continue;
      const x = Math.max(span.left, span.x(range.first));
      const end = Math.min(span.left + span.width, span.x(range.last + 1));
      drawRange(ctx, range, { x, width: Math.max(1, end - x), ...row }, isLight);
    }
  },
  drawFront(ctx, { span, row, isLight, rowOf }) {
    drawTrimmed(ctx, span, row, isLight);
    drawMarked(ctx, span, rowOf(topTagKey)?.top ?? row.top, row.top + row.height);
  },
  label(index, isLight) {
    const lead = leadAt(index)?.lead ?? null;
    const tint = typeof lead === "number" ? colorOf(lead, isLight) : ui("dim");
    return { name: "labels", value: lead === null ? DASH : leadName(lead), tint };
  },
  press(span, x) {
    const end = endAt(span, x);
    return end ? dragEnd(span, end) : dragMarks(span, span.index(x), leadSelected);
  },
  click(span, x) {
    const lead = leadAt(span.index(x))?.lead;
    if (typeof lead === "number") set("track", lead);
  },
  cursor: (span, x) => (endAt(span, x) ? "ew-resize" : ""),
};

/** Set the selected track as lead in the marked frames. @returns {boolean} whether one is selected */
function leadSelected() {
  const track = get("track");
  if (track !== null) paint(track);
  return track !== null;
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {LeadRange} range
 * @param {{x: number, width: number, top: number, height: number}} box
 * @param {boolean} isLight
 */
function drawRange(ctx, { lead, state }, box, isLight) {
  const tint = typeof lead === "number" ? colorOf(lead, isLight) : ui("dim");
  ctx.fillStyle = ctx.strokeStyle = tint;
  ctx.globalAlpha = typeof lead === "number" ? (state === "proposed" ? 0.45 : 1) : 0.25;
  ctx.fillRect(box.x, box.top, box.width, box.height);
  ctx.globalAlpha = 1;
  if (state === "proposed") hatch(ctx, box);
  ctx.fillStyle = ui("bg");
  ctx.fillRect(box.x + box.width - 0.5, box.top, 1, box.height);
  if (box.width < NAME_FROM_PX) return;
  ctx.font = FONT;
  ctx.textBaseline = "middle";
  ctx.fillStyle = typeof lead !== "number" || state === "proposed" ? ui("text") : isLight ? "#fff" : "#0a0c0f";
  ctx.fillText(leadName(lead), box.x + 5, box.top + box.height / 2 + 0.5, box.width - 6);
  ctx.textBaseline = "alphabetic";
}

/**
 * Hatching of a proposal.
 * @param {CanvasRenderingContext2D} ctx
 * @param {{x: number, width: number, top: number, height: number}} box
 */
function hatch(ctx, { x, width, top, height }) {
  ctx.fillStyle = ui("warn");
  for (let at = x; at < x + width; at += HATCH_PX)
    ctx.fillRect(at, top + height - 2, Math.min(HATCH_PX - 2, x + width - at), 2);
}

/**
 * Preview of a range being resized.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Span} span
 * @param {Row} row
 * @param {boolean} isLight
 */
function drawTrimmed(ctx, span, row, isLight) {
  const held = get("trimmed");
  if (!held) return;
  const clamp = (/** @type {number} */ frame) => Math.min(span.left + span.width, Math.max(span.left, span.x(frame)));
  const [before, from, to, after] = [
    Math.min(held.range.first, held.first),
    held.first,
    held.last + 1,
    Math.max(held.range.last, held.last) + 1,
  ].map(clamp);
  ctx.fillStyle = ui("raised");
  ctx.fillRect(before, row.top, after - before, row.height);
  drawRange(ctx, held.range, { x: from, width: Math.max(1, to - from), ...row }, isLight);
  ctx.strokeStyle = ui("accent");
  ctx.lineWidth = 2;
  ctx.strokeRect(from + 1, row.top + 1, Math.max(2, to - from - 2), row.height - 2);
}

/**
 * A frame around the marked frames, from the first lane of tags down to the leads.
 * @param {CanvasRenderingContext2D} ctx @param {Span} span @param {number} top @param {number} bottom
 */
function drawMarked(ctx, span, top, bottom) {
  if (!get("marked")) return;
  const { first, last } = marked(),
    x = Math.max(span.left, span.x(first));
  const end = Math.min(span.left + span.width, span.x(last + 1));
  if (end <= x) return;
  ctx.strokeStyle = ui("accent");
  ctx.lineWidth = 2;
  ctx.strokeRect(x + 1, top + 1, Math.max(2, end - x - 2), bottom - top - 2);
}
