/** The labels' rows of the timeline: who leads, above what the pipeline says; where the selected track is, with its keyframes; and which
 * frames are tagged. */
import { color, ui } from "../core/colors.js";
import { get } from "../core/store.js";
import { colorOf } from "../timeline/ribbon.js";
import { chosen, leadName } from "./state/labels.js";
import { span as marked } from "./state/marked_frames.js";
import { rangesOf, saidTags, WHOLE_TAG } from "./acts/tags.js";

/** @typedef {import("../timeline/span.js").Span} Span */
/** @typedef {import("../timeline/rows.js").Row} Row */
/** @typedef {import("./state/types.js").LeadRange} LeadRange */

const NAME_FROM_PX = 22, HATCH_PX = 5, MOST_TAGS = 3;
const FONT = '600 10.5px system-ui, "DejaVu Sans", sans-serif';

/** @param {CanvasRenderingContext2D} ctx @param {Span} span @param {{leads: Row, track: Row, tags: Row[]}} rows @param {boolean} isLight */
export function drawLabelRows(ctx, span, { leads, track, tags }, isLight) {
  ctx.fillStyle = ui("raised");
  ctx.fillRect(span.left, leads.top, span.width, leads.height);
  for (const range of get("labels")?.leads ?? []) {
    if (range.state === "rejected" || range.last < span.first || range.first > span.end) continue;
    const x = Math.max(span.left, span.x(range.first)), end = Math.min(span.left + span.width, span.x(range.last + 1));
    drawRange(ctx, range, { x, width: Math.max(1, end - x), ...leads }, isLight);
  }
  drawTrack(ctx, span, track);
  for (const [place, { words }] of tagRows().slice(0, tags.length).entries()) for (const word of words) drawTag(ctx, span, tags[place], word);
}

/** What stands in each row of tags: a word, and in the last all that have no room; where there are none yet, a row to mark frames in. @returns {{name: string, words: string[]}[]} */
export function tagRows() {
  const words = saidTags(), rest = words.slice(MOST_TAGS - 1);
  if (!words.length) return [{ name: "tags", words: [] }];
  const rows = words.slice(0, MOST_TAGS - (rest.length > 1 ? 1 : 0)).map((word) => ({ name: word, words: [word] }));
  return rest.length > 1 ? [...rows, { name: `${rest.length} other tags`, words: rest }] : rows;
}

/** @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row @param {string} word */
function drawTag(ctx, span, row, word) {
  ctx.fillStyle = ui(word === WHOLE_TAG ? "ok" : "accent");
  ctx.globalAlpha = 0.8;
  for (const { first, last } of rangesOf(word)) {
    if (last < span.first || first > span.end) continue;
    const x = Math.max(span.left, span.x(first)), end = Math.min(span.left + span.width, span.x(last + 1));
    ctx.fillRect(x, row.top + 3, Math.max(1, end - x - 1), row.height - 6);
  }
  ctx.globalAlpha = 1;
}

/** @param {CanvasRenderingContext2D} ctx @param {LeadRange} range @param {{x: number, width: number, top: number, height: number}} box @param {boolean} isLight */
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

/** Nobody has looked at it yet. @param {CanvasRenderingContext2D} ctx @param {{x: number, width: number, top: number, height: number}} box */
function hatch(ctx, { x, width, top, height }) {
  ctx.fillStyle = ui("warn");
  for (let at = x; at < x + width; at += HATCH_PX) ctx.fillRect(at, top + height - 2, Math.min(HATCH_PX - 2, x + width - at), 2);
}

/** @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row */
function drawTrack(ctx, span, row) {
  const track = chosen();
  if (!track || track.first === null || track.last === null) return;
  const x = span.x(track.first);
  ctx.fillStyle = color("fused");
  ctx.globalAlpha = 0.45;
  ctx.fillRect(x, row.top + 2, Math.max(2, span.x(track.last + 1) - x), row.height - 4);
  ctx.globalAlpha = 1;
  ctx.fillStyle = ui("text");
  for (const frame of track.keyframes) {
    if (frame < span.first - 1 || frame > span.end) continue;
    ctx.fillRect(Math.round(span.middle(frame)) - 1, row.top, 2, row.height);
  }
}

/** A range whose end is under a hand, as it would be; what it leaves is empty. @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row @param {boolean} isLight */
export function drawTrimmed(ctx, span, row, isLight) {
  const held = get("trimmed");
  if (!held) return;
  const clamp = (/** @type {number} */ frame) => Math.min(span.left + span.width, Math.max(span.left, span.x(frame)));
  const [before, from, to, after] = [Math.min(held.range.first, held.first), held.first, held.last + 1, Math.max(held.range.last, held.last) + 1].map(clamp);
  ctx.fillStyle = ui("raised");
  ctx.fillRect(before, row.top, after - before, row.height);
  drawRange(ctx, held.range, { x: from, width: Math.max(1, to - from), ...row }, isLight);
  ctx.strokeStyle = ui("accent");
  ctx.lineWidth = 2;
  ctx.strokeRect(from + 1, row.top + 1, Math.max(2, to - from - 2), row.height - 2);
}

/** What is marked, over the rows that it may be said in. @param {CanvasRenderingContext2D} ctx @param {Span} span @param {{leads: Row, tags: Row[]}} rows */
export function drawMarked(ctx, span, { leads, tags }) {
  const top = tags[0]?.top ?? leads.top;
  if (!get("marked")) return;
  const { first, last } = marked(), x = Math.max(span.left, span.x(first)), end = Math.min(span.left + span.width, span.x(last + 1));
  if (end <= x) return;
  ctx.strokeStyle = ui("accent");
  ctx.lineWidth = 2;
  ctx.strokeRect(x + 1, top + 1, Math.max(2, end - x - 2), leads.top + leads.height - top - 2);
}
