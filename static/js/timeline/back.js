/** What of the timeline stays while the cursor moves: axis, flags, ribbons, differences, curves. Drawn when data change. */
import { color, ui } from "../core/colors.js";
import { clock } from "../core/format.js";
import { drawLabelRows } from "../labeling/ribbon.js";
import { get } from "../core/store.js";
import { scaleOf, traceLine, yOf } from "./curves.js";
import { drawFlags } from "./flags.js";
import { colorLeads, drawRibbon } from "./ribbon.js";
import { MARKS_PX } from "./rows.js";

/** @typedef {import("./span.js").Span} Span */
/** @typedef {import("./rows.js").Rows} Rows */
/** @typedef {import("../drive/types.js").Series} Series */
/** @typedef {import("../drive/types.js").Columns} Columns */
/** @typedef {import("./rows.js").Row} Row */

const FONT = '10px system-ui, "DejaVu Sans", sans-serif';
const TICK_STEPS_S = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 3600];
const TICK_FROM_PX = 70;
/** Where a recording has gaps, its seconds lie nearer to each other. */
const TICK_APART_PX = 46;

/**
 * @param {CanvasRenderingContext2D} ctx @param {{width: number, height: number}} size @param {Span} span @param {Rows} rows
 * @param {boolean} isLight
 */
export function drawBack(ctx, size, span, rows, isLight) {
  const drive = get("drive");
  drawAxis(ctx, span, rows, size);
  if (!drive?.now) return;
  ctx.save();
  ctx.beginPath();
  ctx.rect(span.left, 0, span.width, size.height);
  ctx.clip();
  colorLeads([drive.base, drive.now]);
  const look = { isLight, empty: ui("raised"), chosen: get("selection"), ring: ui("text") };
  if (rows.labels) drawLabelRows(ctx, span, rows.labels, isLight);
  drawRibbon(ctx, drive.now, span, rows.ribbon, look);
  if (drive.base && rows.base) {
    ctx.globalAlpha = 0.75;
    drawRibbon(ctx, drive.base, span, rows.base, look);
    ctx.globalAlpha = 1;
    drawDifferences(ctx, span, rows.ribbon, drive.comparison?.differing ?? []);
  }
  drawPending(ctx, span, rows.ribbon, drive.now.done);
  for (const { curve, row } of rows.lanes) drawLane(ctx, span, row, curve, drive.now, drive.base);
  drawFlags(ctx, span, rows.flags, drive.events);
  ctx.restore();
  drawBar(ctx, span, rows.bar);
}

/** @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Rows} rows @param {{width: number, height: number}} size */
function drawAxis(ctx, span, rows, size) {
  const times = get("drive")?.t_s ?? [];
  ctx.font = FONT;
  ctx.fillStyle = ui("dim");
  ctx.strokeStyle = color("grid");
  ctx.lineWidth = 1;
  for (const row of [rows.ribbon, ...rows.lanes.map((lane) => lane.row)]) line(ctx, 0, row.top - 0.5, size.width, row.top - 0.5);
  if (times.length < 2) return;
  const perSecond = (span.perFrame * times.length) / (times[times.length - 1] || 1);
  const step = TICK_STEPS_S.find((s) => s * perSecond >= TICK_FROM_PX) ?? 3600;
  let due = 0, taken = -Infinity;
  for (let i = 0; i < times.length; i++) {
    if (times[i] < due - 1e-6) continue;
    due = (Math.floor(times[i] / step + 1e-6) + 1) * step;
    const x = span.x(i);
    if (x < span.left - 1 || x > span.left + span.width - 30 || x < taken + TICK_APART_PX) continue;
    taken = x;
    line(ctx, x + 0.5, rows.axis.top + 4, x + 0.5, size.height - rows.bar.height);
    ctx.fillText(clock(times[i]), x + 4, rows.axis.top + 11);
  }
}

/** Frames in which the two runs differ, between their ribbons. @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} ribbon @param {[number, number][]} ranges */
function drawDifferences(ctx, span, ribbon, ranges) {
  ctx.fillStyle = ui("warn");
  for (const [first, last] of ranges) {
    const x = span.x(first);
    ctx.fillRect(x, ribbon.top + ribbon.height + 1, Math.max(2, span.x(last + 1) - x), MARKS_PX - 2);
  }
}

/** What is not computed yet. @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row @param {number} done */
function drawPending(ctx, span, row, done) {
  if (done >= span.count) return;
  const x = Math.max(span.left, span.x(done));
  ctx.strokeStyle = ui("line");
  line(ctx, x, row.top + row.height / 2, span.left + span.width, row.top + row.height / 2);
}

/**
 * @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row @param {import("./curves.js").Curve} curve
 * @param {Series} now @param {Series|null} base
 */
function drawLane(ctx, span, row, curve, now, base) {
  const chosen = get("curve");
  const own = chosen && curve.key in chosen && chosen.id !== null ? /** @type {(number|null)[]} */ (chosen[/** @type {"distance_m"} */ (curve.key)]) : null;
  const lines = [now, base].flatMap((series) => (series ? [series.columns[curve.key], curve.also ? series.columns[curve.also] : []] : []));
  const scale = scaleOf(curve, /** @type {(number|null)[][]} */ ([...lines, own ?? []]));
  const y = yOf(row, scale, curve.most);
  drawGrid(ctx, span, row, scale, y, curve.limit);
  if (base) stroke(ctx, ofSeries(base, curve.key, curve.factor), span, y, { style: ui("dim"), width: 1, alpha: 0.75 });
  if (curve.also) stroke(ctx, ofSeries(now, curve.also, curve.factor), span, y, { style: ui("dim"), width: 1, alpha: 0.8 });
  const samples = ofSeries(now, curve.key, curve.factor);
  if (curve.isArea) fillArea(ctx, samples, span, y, color(curve.role));
  stroke(ctx, samples, span, y, { style: color(curve.role), width: 1.5 });
  if (own && chosen) {
    const picked = { count: chosen.index.length, index: (/** @type {number} */ i) => chosen.index[i], joined: (/** @type {number} */ i) => chosen.index[i] - chosen.index[i - 1] === 1, value: (/** @type {number} */ i) => (own[i] === null ? null : /** @type {number} */ (own[i]) * curve.factor) };
    stroke(ctx, picked, span, y, { style: ui("accent"), width: 1.5 });
  }
}

/** @typedef {{count: number, index: (i: number) => number, joined: (i: number) => boolean, value: (i: number) => number|null}} Samples */

/** A column as samples; the CIPV's figures do not go on from one object to the next. @param {Series} series @param {keyof Columns} key @param {number} factor @returns {Samples} */
function ofSeries({ done, columns }, key, factor) {
  const values = /** @type {(number|null)[]} */ (columns[key]), ids = columns.cipv_id;
  const isLeads = !["speed_mps", "desired_speed_mps", "brake"].includes(key);
  return {
    count: done, index: (i) => i, joined: (i) => !isLeads || ids[i] === ids[i - 1],
    value: (i) => (values[i] === null ? null : /** @type {number} */ (values[i]) * factor),
  };
}

/**
 * @param {CanvasRenderingContext2D} ctx @param {Samples} samples @param {Span} span @param {(value: number) => number} y
 * @param {{style: string, width: number, alpha?: number}} pen
 */
function stroke(ctx, samples, span, y, { style, width, alpha = 1 }) {
  ctx.strokeStyle = style;
  ctx.lineWidth = width;
  ctx.globalAlpha = alpha;
  ctx.lineJoin = "round";
  traceLine(ctx, samples.value, samples, span, y);
  ctx.stroke();
  ctx.globalAlpha = 1;
}

/** @param {CanvasRenderingContext2D} ctx @param {Samples} samples @param {Span} span @param {(value: number) => number} y @param {string} tint */
function fillArea(ctx, samples, span, y, tint) {
  ctx.fillStyle = tint;
  ctx.globalAlpha = 0.35;
  ctx.beginPath();
  const step = Math.max(1, Math.floor(1 / span.perFrame)), floor = y(0);
  for (let i = Math.max(0, Math.floor(span.first)); i < Math.min(samples.count, span.end); i += step) {
    const value = samples.value(i);
    if (value) ctx.rect(span.x(i), y(value), step * span.perFrame, floor - y(value));
  }
  ctx.fill();
  ctx.globalAlpha = 1;
}

/**
 * @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row @param {{low: number, high: number}} scale
 * @param {(value: number) => number} y @param {number} [limit]
 */
function drawGrid(ctx, span, row, { low, high }, y, limit) {
  ctx.font = "9px system-ui, sans-serif";
  ctx.fillStyle = ui("dim");
  ctx.strokeStyle = color("grid");
  ctx.lineWidth = 1;
  if (low < 0) line(ctx, span.left, y(0), span.left + span.width, y(0));
  if (limit !== undefined) {
    ctx.fillStyle = ui("danger");
    for (let x = span.left; x < span.left + span.width; x += 8) ctx.fillRect(x, y(limit), 3, 1);
    ctx.fillStyle = ui("dim");
  }
  if (row.height < 28) return;
  ctx.textAlign = "right";
  const edge = span.left + span.width - 3;
  ctx.fillText(short(high), edge, row.top + 10);
  ctx.fillText(short(low), edge, row.top + row.height - 3);
  ctx.textAlign = "start";
}

const short = (/** @type {number} */ value) => (Math.abs(value) < 3 ? value.toFixed(1) : value.toFixed(0)).replace("-", "−");

/** Which part of the recording is shown, when it is not all of it. @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row */
function drawBar(ctx, span, row) {
  if (span.isWhole) return;
  ctx.fillStyle = ui("raised");
  ctx.fillRect(span.left, row.top + 1, span.width, row.height - 2);
  ctx.fillStyle = ui("dim");
  ctx.fillRect(span.left + (span.first / span.count) * span.width, row.top + 1, Math.max(12, ((span.end - span.first) / span.count) * span.width), row.height - 2);
}

/** @param {CanvasRenderingContext2D} ctx @param {number} x1 @param {number} y1 @param {number} x2 @param {number} y2 */
function line(ctx, x1, y1, x2, y2) {
  ctx.beginPath();
  ctx.moveTo(x1, y1);
  ctx.lineTo(x2, y2);
  ctx.stroke();
}
