/**
 * A curve of the CIPV, ACC or ego speed over the drive: the current run, the compared run and the selected object.
 */
import { color, ui } from "../../core/colors.js";
import { DASH } from "../../core/format.js";
import { get } from "../../core/store.js";
import { hasData, isShown, said, scaleOf, traceLine, yOf } from "../curves.js";

/** @typedef {import("../span.js").Span} Span */
/** @typedef {import("../rows.js").Row} Row */
/** @typedef {import("../../drive/types.js").Series} Series */
/** @typedef {import("../../drive/types.js").Columns} Columns */

const LEAST_PX = 20;

/** @param {import("../curves.js").Curve} curve @returns {import("./registry.js").Lane} */
export const curveLane = (curve) => ({
  key: curve.key,
  height: () => (isShown(curve) && hasData(curve) ? LEAST_PX : 0),
  grows: true,
  isRuled: true,
  draw(ctx, { span, row }) {
    const drive = get("drive");
    if (drive?.now) drawCurve(ctx, span, row, curve, drive.now, drive.base);
  },
  label(index) {
    const value = /** @type {number|null} */ (get("drive")?.now?.columns[curve.key][index] ?? null);
    return { name: curve.label, value: value === null ? DASH : said(curve, value), tint: ui("text") };
  },
});

/**
 * @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row @param {import("../curves.js").Curve} curve
 * @param {Series} now @param {Series|null} base
 */
function drawCurve(ctx, span, row, curve, now, base) {
  const chosen = get("curve");
  const own =
    chosen && curve.key in chosen && chosen.id !== null
      ? /** @type {(number|null)[]} */ (chosen[/** @type {"distance_m"} */ (curve.key)])
      : null;
  const lines = [now, base].flatMap((series) =>
    series ? [series.columns[curve.key], curve.also ? series.columns[curve.also] : []] : [],
  );
  const scale = scaleOf(curve, /** @type {(number|null)[][]} */ ([...lines, own ?? []]));
  const y = yOf(row, scale, curve.most);
  drawGrid(ctx, span, row, scale, y, curve);
  if (base) stroke(ctx, ofSeries(base, curve.key, curve.factor), span, y, { style: ui("dim"), width: 1, alpha: 0.75 });
  if (curve.also)
    stroke(ctx, ofSeries(now, curve.also, curve.factor), span, y, { style: ui("dim"), width: 1, alpha: 0.8 });
  const samples = ofSeries(now, curve.key, curve.factor);
  if (curve.isArea) fillArea(ctx, samples, span, y, color(curve.role));
  stroke(ctx, samples, span, y, { style: color(curve.role), width: 1.5 });
  if (own && chosen) {
    const picked = {
      count: chosen.index.length,
      index: (/** @type {number} */ i) => chosen.index[i],
      joined: (/** @type {number} */ i) => chosen.index[i] - chosen.index[i - 1] === 1,
      value: (/** @type {number} */ i) => (own[i] === null ? null : /** @type {number} */ (own[i]) * curve.factor),
    };
    stroke(ctx, picked, span, y, { style: ui("accent"), width: 1.5 });
  }
}

/**
 * @typedef
 *   {{count: number, index: (i: number) => number, joined: (i: number) => boolean, value: (i: number) => number|null}}
 *   Samples
 */

/**
 * A column as samples, not joined across clips of the recording, and CIPV values not across changes of the object.
 * @param {Series} series
 * @param {keyof Columns} key
 * @param {number} factor
 * @returns {Samples}
 */
function ofSeries({ done, columns }, key, factor) {
  const values = /** @type {(number|null)[]} */ (columns[key]),
    ids = columns.cipv_id;
  const starts = new Set(get("drive")?.clips);
  const isLeads = !["speed_mps", "desired_speed_mps", "brake"].includes(key);
  return {
    count: done,
    index: (i) => i,
    joined: (i) => !starts.has(i) && (!isLeads || ids[i] === ids[i - 1]),
    value: (i) => (values[i] === null ? null : /** @type {number} */ (values[i]) * factor),
  };
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {Samples} samples
 * @param {Span} span
 * @param {(value: number) => number} y
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

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {Samples} samples
 * @param {Span} span
 * @param {(value: number) => number} y
 * @param {string} tint
 */
function fillArea(ctx, samples, span, y, tint) {
  ctx.fillStyle = tint;
  ctx.globalAlpha = 0.35;
  ctx.beginPath();
  const step = Math.max(1, Math.floor(1 / span.perFrame)),
    floor = y(0);
  for (let i = Math.max(0, Math.floor(span.first)); i < Math.min(samples.count, span.end); i += step) {
    const value = samples.value(i);
    if (value) ctx.rect(span.x(i), y(value), step * span.perFrame, floor - y(value));
  }
  ctx.fill();
  ctx.globalAlpha = 1;
}

/**
 * @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row @param {{low: number, high: number}} scale
 * @param {(value: number) => number} y @param {import("../curves.js").Curve} curve
 */
function drawGrid(ctx, span, row, { low, high }, y, { limit, unit }) {
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
  ctx.fillText(`${short(high)} ${unit}`, edge, row.top + 10);
  ctx.fillText(`${short(low)} ${unit}`, edge, row.top + row.height - 3);
  ctx.textAlign = "start";
}

const short = (/** @type {number} */ value) =>
  (value && Math.abs(value) < 3 ? value.toFixed(1) : value.toFixed(0)).replace("-", "−");

/** @param {CanvasRenderingContext2D} ctx @param {number} x1 @param {number} y1 @param {number} x2 @param {number} y2 */
function line(ctx, x1, y1, x2, y2) {
  ctx.beginPath();
  ctx.moveTo(x1, y1);
  ctx.lineTo(x2, y2);
  ctx.stroke();
}
