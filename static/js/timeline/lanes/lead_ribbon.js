/** A ribbon of the CIPV per frame, coloured by id and hatched by source. */
import { ui } from "../../core/colors.js";
import { isImaged, isTrackedByTwo } from "../../core/object_sources.js";
import { get } from "../../core/store.js";

/** @typedef {import("../../drive/types.js").Series} Series */
/** @typedef {import("../span.js").Span} Span */
/** @typedef {{first: number, end: number, id: number|null, source: string|null, carried: boolean}} Stretch */

/** Degrees of hue from one lead to the next: the golden angle keeps the first dozens apart. */
const HUE_STEP = 137.508,
  FIRST_HUE = 190;
const HATCH_PX = 6;
/** Minimum width for a label. */
const NUMBER_FROM_PX = 24;

/** Order in which leads appear, by id. @type {Map<number, number>} */
let places = new Map();

/**
 * Assign colours to leads, the compared run's first, so that both runs share them.
 * @param {(Series|null)[]} runs
 */
export function colorLeads(runs) {
  places = new Map();
  for (const series of runs) {
    for (const id of series?.columns.cipv_id ?? []) if (id !== null && !places.has(id)) places.set(id, places.size);
  }
}

/** @param {number} id @param {boolean} isLight */
export function colorOf(id, isLight) {
  const hue = Math.round((FIRST_HUE + (places.get(id) ?? id) * HUE_STEP) % 360);
  return isLight ? `hsl(${hue} 55% 38%)` : `hsl(${hue} 58% 66%)`;
}

/**
 * Consecutive frames with the same lead and source.
 * @param {Series} series @returns {Stretch[]}
 */
function stretches({ done, columns }) {
  /** @type {Stretch[]} */
  const found = [];
  for (let i = 0; i < done; i++) {
    const id = columns.cipv_id[i],
      source = columns.source[i],
      carried = columns.carried[i] === true;
    const last = found.at(-1);
    if (last && last.id === id && last.source === source && last.carried === carried) last.end = i + 1;
    else found.push({ first: i, end: i + 1, id, source, carried });
  }
  return found;
}

/** @typedef {{isLight: boolean, chosen: number|null, ring: string}} Look */

/** @param {CanvasRenderingContext2D} ctx @param {Series} series @param {import("./registry.js").Place} place */
export function drawRibbon(ctx, series, { span, row, isLight }) {
  const look = { isLight, chosen: get("selection"), ring: ui("text") };
  ctx.fillStyle = ui("raised");
  ctx.fillRect(span.left, row.top, span.width, row.height);
  for (const stretch of stretches(series)) {
    if (stretch.id === null || stretch.end <= span.first || stretch.first >= span.end) continue;
    const x = Math.max(span.left, span.x(stretch.first)),
      width = Math.max(1, Math.min(span.left + span.width, span.x(stretch.end)) - x);
    drawStretch(ctx, { ...stretch, id: stretch.id }, { x, width, ...row }, look);
  }
}

/**
 * @param {CanvasRenderingContext2D} ctx @param {{id: number, source: string|null, carried: boolean}} stretch
 * @param {{x: number, width: number, top: number, height: number}} box @param {Look} look
 */
function drawStretch(ctx, { id, source, carried }, box, look) {
  ctx.globalAlpha = carried ? 0.4 : 1;
  ctx.fillStyle = colorOf(id, look.isLight);
  ctx.fillRect(box.x, box.top, box.width, box.height);
  if (!isTrackedByTwo({ source })) hatch(ctx, box, isImaged({ source }) ? 1 : -1, look.isLight);
  ctx.globalAlpha = 1;
  if (id === look.chosen) {
    ctx.strokeStyle = look.ring;
    ctx.lineWidth = 2;
    ctx.strokeRect(box.x + 1, box.top + 1, Math.max(1, box.width - 2), box.height - 2);
  }
  if (box.width < NUMBER_FROM_PX || box.height < 11) return;
  ctx.fillStyle = look.isLight ? "#fff" : "#0a0c0f";
  ctx.font = '600 10.5px system-ui, "DejaVu Sans", sans-serif';
  ctx.textBaseline = "middle";
  if (!isTrackedByTwo({ source })) plate(ctx, `#${id}`, box, colorOf(id, look.isLight));
  ctx.fillText(`#${id}`, box.x + 5, box.top + box.height / 2 + 0.5);
  ctx.textBaseline = "alphabetic";
}

/**
 * A plain background for a label on hatching.
 * @param {CanvasRenderingContext2D} ctx
 * @param {string} words
 * @param {{x: number, top: number, height: number}} box
 * @param {string} tint
 */
function plate(ctx, words, box, tint) {
  const { fillStyle } = ctx;
  ctx.fillStyle = tint;
  ctx.fillRect(box.x + 2, box.top, ctx.measureText(words).width + 6, box.height);
  ctx.fillStyle = fillStyle;
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {{x: number, width: number, top: number, height: number}} box
 * @param {1|-1} lean
 * @param {boolean} isLight
 */
function hatch(ctx, box, lean, isLight) {
  ctx.save();
  ctx.beginPath();
  ctx.rect(box.x, box.top, box.width, box.height);
  ctx.clip();
  ctx.beginPath();
  const reach = box.height;
  for (let x = Math.floor((box.x - reach) / HATCH_PX) * HATCH_PX; x < box.x + box.width + reach; x += HATCH_PX) {
    ctx.moveTo(x, lean > 0 ? box.top + reach : box.top);
    ctx.lineTo(x + reach, lean > 0 ? box.top : box.top + reach);
  }
  ctx.strokeStyle = isLight ? "rgb(255 255 255 / .55)" : "rgb(8 10 13 / .6)";
  ctx.lineWidth = 2;
  ctx.stroke();
  ctx.restore();
}
