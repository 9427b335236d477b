/** Draws the two layers of the timeline: the recording, and on top of it pointer edits. */
import { color, ui } from "../core/colors.js";
import { get } from "../core/store.js";
import { here } from "../drive/seek.js";
import { drawAxis, drawBar } from "./axis.js";
import { colorLeads } from "./lanes/lead_ribbon.js";

/** @typedef {import("./span.js").Span} Span */
/** @typedef {import("./rows.js").Rows} Rows */
/** @typedef {{width: number, height: number}} Size */

/** @param {Span} span @param {Rows} rows @param {boolean} isLight */
const placer = (span, rows, isLight) => {
  const rowOf = (/** @type {string} */ key) => rows.lanes.find(({ lane }) => lane.key === key)?.row ?? null;
  return (/** @type {import("./rows.js").Row} */ row) => ({ span, row, isLight, rowOf });
};

/**
 * The part that does not change with the cursor: axis and lanes. Drawn when data change.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Size} size
 * @param {Span} span
 * @param {Rows} rows
 * @param {boolean} isLight
 */
export function drawBack(ctx, size, span, rows, isLight) {
  const drive = get("drive"),
    place = placer(span, rows, isLight);
  drawAxis(ctx, size, span, rows);
  drawSeams(ctx, span, rows, drive?.clips ?? []);
  if (!drive?.now) return;
  ctx.save();
  ctx.beginPath();
  ctx.rect(span.left, 0, span.width, size.height);
  ctx.clip();
  colorLeads([drive.base, drive.now]);
  for (const { lane, row } of [...rows.lanes].reverse()) lane.draw(ctx, place(row));
  ctx.restore();
  drawBar(ctx, span, rows);
}

/**
 * The marked clip, the lanes' pointer edits, and the frame under the pointer.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Size} size
 * @param {Span} span
 * @param {Rows} rows
 * @param {number|null} hover the frame under the pointer
 * @param {boolean} isLight
 */
export function drawFront(ctx, size, span, rows, hover, isLight) {
  const place = placer(span, rows, isLight);
  drawClip(ctx, size, span, rows);
  for (const { lane, row } of rows.lanes) lane.drawFront?.(ctx, place(row));
  if (hover !== null && hover !== here()) drawLine(ctx, span, hover, rows.axis.height, size.height);
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {Span} span
 * @param {number} index
 * @param {number} top
 * @param {number} bottom
 */
function drawLine(ctx, span, index, top, bottom) {
  const x = Math.round(span.middle(index));
  if (!span.holds(x)) return;
  ctx.fillStyle = ui("dim");
  ctx.fillRect(x - 0.5, top, 1.5, bottom - top);
}

/**
 * Borders between clips of the recording: nothing is carried across them, and the time between is left out.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Span} span
 * @param {Rows} rows
 * @param {number[]} clips first frame of each
 */
function drawSeams(ctx, span, rows, clips) {
  ctx.fillStyle = ui("dim");
  const bottom = rows.bar.top;
  for (const first of clips.slice(1)) {
    const x = Math.round(span.x(first));
    if (!span.holds(x)) continue;
    for (let y = rows.axis.top; y < bottom; y += 6) ctx.fillRect(x - 0.5, y, 1, 3);
  }
}

/**
 * Dim everything outside the marked clip.
 * @param {CanvasRenderingContext2D} ctx
 * @param {{height: number}} size
 * @param {Span} span
 * @param {Rows} rows
 */
function drawClip(ctx, { height }, span, rows) {
  const clip = get("clip");
  if (!clip) return;
  const right = span.left + span.width;
  const from = Math.min(right, Math.max(span.left, span.x(clip.first))),
    to = Math.min(right, Math.max(span.left, span.x(clip.last + 1)));
  ctx.globalAlpha = 0.55;
  ctx.fillStyle = ui("bg");
  ctx.fillRect(span.left, 0, from - span.left, height);
  ctx.fillRect(to, 0, right - to, height);
  ctx.globalAlpha = 1;
  ctx.fillStyle = color("cluster");
  for (const [x, side] of [
    [from, 1],
    [to, -1],
  ]) {
    ctx.fillRect(x - (side < 0 ? 2 : 0), rows.axis.top, 2, height);
    ctx.fillRect(x - (side < 0 ? 7 : 0), rows.axis.top, 7, rows.axis.height - 3);
  }
}
