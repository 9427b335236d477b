/** What of the timeline moves with the frame: cursor, the values at it, and the marked clip. Cheap: ten times a second. */
import { color, ui } from "../colors.js";
import { here } from "../drive/seek.js";
import { DASH, num } from "../format.js";
import { leadAt, leadName } from "../labeling/held.js";
import { drawMarked } from "../labeling/ribbon.js";
import { get } from "../store.js";
import { colorOf } from "./ribbon.js";

/** @typedef {import("./span.js").Span} Span */
/** @typedef {import("./rows.js").Rows} Rows */

const LABEL = '10.5px system-ui, "DejaVu Sans", sans-serif';
const VALUE = '600 10.5px system-ui, "DejaVu Sans", sans-serif';

/**
 * @param {CanvasRenderingContext2D} ctx @param {{width: number, height: number}} size @param {Span} span @param {Rows} rows
 * @param {{isLight: boolean, hover: number|null}} look  hover: the frame under the pointer
 */
export function drawFront(ctx, size, span, rows, { isLight, hover }) {
  drawClip(ctx, size, span, rows);
  if (rows.labels) drawMarked(ctx, span, rows.labels.leads);
  const index = here();
  if (hover !== null && hover !== index) drawLine(ctx, span, hover, ui("dim"), rows.axis.height, size.height);
  drawLine(ctx, span, index, ui("accent"), 0, size.height);
  drawHandle(ctx, span, index);
  drawLabels(ctx, rows, hover ?? index, isLight, span.left);
}

/** @param {CanvasRenderingContext2D} ctx @param {Span} span @param {number} index @param {string} style @param {number} top @param {number} bottom */
function drawLine(ctx, span, index, style, top, bottom) {
  const x = Math.round(span.middle(index));
  if (x < span.left || x > span.left + span.width) return;
  ctx.fillStyle = style;
  ctx.fillRect(x - 0.5, top, 1.5, bottom - top);
}

/** @param {CanvasRenderingContext2D} ctx @param {Span} span @param {number} index */
function drawHandle(ctx, span, index) {
  const x = span.middle(index);
  if (x < span.left || x > span.left + span.width) return;
  ctx.fillStyle = ui("accent");
  ctx.beginPath();
  ctx.moveTo(x - 5, 0);
  ctx.lineTo(x + 5.5, 0);
  ctx.lineTo(x + 0.25, 8);
  ctx.fill();
}

/** Names at the left and the values at the frame looked at. @param {CanvasRenderingContext2D} ctx @param {Rows} rows @param {number} index @param {boolean} isLight @param {number} edge */
function drawLabels(ctx, rows, index, isLight, edge) {
  const drive = get("drive"), columns = drive?.now?.columns;
  ctx.textBaseline = "middle";
  const lead = rows.labels ? leadAt(index)?.lead ?? null : null;
  if (rows.labels) label(ctx, "labels", lead === null ? DASH : leadName(lead), rows.labels.leads, edge, typeof lead === "number" ? colorOf(lead, isLight) : ui("dim"));
  const id = columns?.cipv_id[index] ?? null;
  label(ctx, rows.labels ? "pipeline" : "CIPV", id === null ? DASH : `#${id}`, rows.ribbon, edge, id === null ? ui("dim") : colorOf(id, isLight));
  if (rows.base) {
    const was = drive?.base?.columns.cipv_id[index] ?? null;
    label(ctx, "before", was === null ? DASH : `#${was}`, rows.base, edge, was === null ? ui("dim") : colorOf(was, isLight));
  }
  for (const { curve, row } of rows.lanes) {
    const value = /** @type {number|null} */ (columns?.[curve.key][index] ?? null);
    label(ctx, curve.label, value === null ? DASH : `${num(value * curve.factor, curve.digits)} ${curve.unit}`, row, edge, ui("text"));
  }
  ctx.textAlign = "start";
  ctx.textBaseline = "alphabetic";
}

/** @param {CanvasRenderingContext2D} ctx @param {string} name @param {string} value @param {{top: number, height: number}} row @param {number} edge @param {string} tint */
function label(ctx, name, value, row, edge, tint) {
  const y = row.top + row.height / 2;
  ctx.fillStyle = ui("dim");
  ctx.font = LABEL;
  ctx.textAlign = "left";
  ctx.fillText(name, 8, y);
  ctx.fillStyle = tint;
  ctx.font = VALUE;
  ctx.textAlign = "right";
  ctx.fillText(value, edge - 8, y);
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
