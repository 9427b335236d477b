/** Draws the timeline's seconds along the top, lines between lanes, and the scroll bar. */
import { color, ui } from "../core/colors.js";
import { clock } from "../core/format.js";
import { get } from "../core/store.js";

/** @typedef {import("./span.js").Span} Span */
/** @typedef {import("./rows.js").Rows} Rows */
/** @typedef {{width: number, height: number}} Size */

const FONT = '10px system-ui, "DejaVu Sans", sans-serif';
const TICK_STEPS_S = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 3600];
const TICK_FROM_PX = 70;
/** Minimum tick spacing: seconds are closer together where a recording has gaps. */
const TICK_APART_PX = 46;

/** @param {CanvasRenderingContext2D} ctx @param {Size} size @param {Span} span @param {Rows} rows */
export function drawAxis(ctx, size, span, rows) {
  const times = get("drive")?.t_s ?? [];
  ctx.font = FONT;
  ctx.fillStyle = ui("dim");
  ctx.strokeStyle = color("grid");
  ctx.lineWidth = 1;
  for (const { lane, row } of rows.lanes) if (lane.isRuled) line(ctx, 0, row.top - 0.5, size.width, row.top - 0.5);
  if (times.length < 2) return;
  const perSecond = (span.perFrame * times.length) / (times[times.length - 1] || 1);
  const step = TICK_STEPS_S.find((s) => s * perSecond >= TICK_FROM_PX) ?? 3600;
  let due = 0,
    taken = -Infinity;
  for (let i = 0; i < times.length; i++) {
    if (times[i] < due - 1e-6) continue;
    // a round time between two frames; the frame's own after a gap
    const before = times[i - 1] ?? times[i],
      isRound = due > before && times[i] - before <= step,
      at = isRound ? due : times[i];
    due = (Math.floor(times[i] / step + 1e-6) + 1) * step;
    const x = isRound ? span.x(i - (times[i] - at) / (times[i] - before)) : span.x(i);
    if (x < span.left - 1 || x > span.left + span.width - 30 || x < taken + TICK_APART_PX) continue;
    taken = x;
    line(ctx, x + 0.5, rows.axis.top + 4, x + 0.5, size.height - rows.bar.height);
    ctx.fillText(clock(at), x + 4, rows.axis.top + 11);
  }
}

/**
 * The scroll bar: the part of the recording that is shown; hidden if that is all of it.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Span} span
 * @param {Rows} rows
 */
export function drawBar(ctx, span, { bar }) {
  if (span.isWhole) return;
  ctx.fillStyle = ui("raised");
  ctx.fillRect(span.left, bar.top + 1, span.width, bar.height - 2);
  ctx.fillStyle = ui("dim");
  const x = span.left + (span.first / span.count) * span.width;
  ctx.fillRect(x, bar.top + 1, Math.max(12, ((span.end - span.first) / span.count) * span.width), bar.height - 2);
}

/** @param {CanvasRenderingContext2D} ctx @param {number} x1 @param {number} y1 @param {number} x2 @param {number} y2 */
function line(ctx, x1, y1, x2, y2) {
  ctx.beginPath();
  ctx.moveTo(x1, y1);
  ctx.lineTo(x2, y2);
  ctx.stroke();
}
