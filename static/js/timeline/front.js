/** What a hand has put onto the timeline: the marked clip, labels being painted, and the frame under the pointer. */
import { color, ui } from "../core/colors.js";
import { here } from "../drive/seek.js";
import { drawMarked, drawTrimmed } from "../labeling/ribbon.js";
import { get } from "../core/store.js";

/** @typedef {import("./span.js").Span} Span */
/** @typedef {import("./rows.js").Rows} Rows */

/**
 * @param {CanvasRenderingContext2D} ctx @param {{width: number, height: number}} size @param {Span} span @param {Rows} rows
 * @param {number|null} hover the frame under the pointer @param {boolean} isLight
 */
export function drawFront(ctx, size, span, rows, hover, isLight) {
  drawClip(ctx, size, span, rows);
  if (rows.labels) drawTrimmed(ctx, span, rows.labels.leads, isLight);
  if (rows.labels) drawMarked(ctx, span, rows.labels);
  if (hover !== null && hover !== here()) drawLine(ctx, span, hover, rows.axis.height, size.height);
}

/** @param {CanvasRenderingContext2D} ctx @param {Span} span @param {number} index @param {number} top @param {number} bottom */
function drawLine(ctx, span, index, top, bottom) {
  const x = Math.round(span.middle(index));
  if (!span.holds(x)) return;
  ctx.fillStyle = ui("dim");
  ctx.fillRect(x - 0.5, top, 1.5, bottom - top);
}

/** What is outside the marked clip is dimmed. @param {CanvasRenderingContext2D} ctx @param {{height: number}} size @param {Span} span @param {Rows} rows */
function drawClip(ctx, { height }, span, rows) {
  const clip = get("clip");
  if (!clip) return;
  const right = span.left + span.width;
  const from = Math.min(right, Math.max(span.left, span.x(clip.first))), to = Math.min(right, Math.max(span.left, span.x(clip.last + 1)));
  ctx.globalAlpha = 0.55;
  ctx.fillStyle = ui("bg");
  ctx.fillRect(span.left, 0, from - span.left, height);
  ctx.fillRect(to, 0, right - to, height);
  ctx.globalAlpha = 1;
  ctx.fillStyle = color("cluster");
  for (const [x, side] of [[from, 1], [to, -1]]) {
    ctx.fillRect(x - (side < 0 ? 2 : 0), rows.axis.top, 2, height);
    ctx.fillRect(x - (side < 0 ? 7 : 0), rows.axis.top, 7, rows.axis.height - 3);
  }
}
