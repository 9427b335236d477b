/** What of the timeline moves with the frame: the names of its rows with the values at a frame, and the cursor. They are small
 * and apart from the rest, so that ten times a second little is drawn and nothing large is put on the screen again. */
import { ui } from "../core/colors.js";
import { DASH } from "../core/format.js";
import { leadAt, leadName } from "../labeling/state/labels.js";
import { tagRows } from "../labeling/ribbon.js";
import { get } from "../core/store.js";
import { said } from "./curves.js";
import { colorOf } from "./ribbon.js";

/** @typedef {import("./rows.js").Rows} Rows */

const LABEL = '10.5px system-ui, "DejaVu Sans", sans-serif';
const VALUE = '600 10.5px system-ui, "DejaVu Sans", sans-serif';

/** Names at the left and the values at the frame looked at. @param {CanvasRenderingContext2D} ctx @param {Rows} rows @param {number} index @param {boolean} isLight @param {number} edge */
export function drawValues(ctx, rows, index, isLight, edge) {
  const drive = get("drive"), columns = drive?.now?.columns;
  ctx.textBaseline = "middle";
  const lead = rows.labels ? leadAt(index)?.lead ?? null : null;
  if (rows.labels) label(ctx, "labels", lead === null ? DASH : leadName(lead), rows.labels.leads, edge, typeof lead === "number" ? colorOf(lead, isLight) : ui("dim"));
  for (const [place, row] of (rows.labels?.tags ?? []).entries()) label(ctx, tagRows()[place]?.name ?? "", "", row, edge, ui("dim"));
  const id = columns?.cipv_id[index] ?? null;
  label(ctx, rows.labels ? "pipeline" : "CIPV", id === null ? DASH : `#${id}`, rows.ribbon, edge, id === null ? ui("dim") : colorOf(id, isLight));
  if (rows.base) {
    const was = drive?.base?.columns.cipv_id[index] ?? null;
    label(ctx, "before", was === null ? DASH : `#${was}`, rows.base, edge, was === null ? ui("dim") : colorOf(was, isLight));
  }
  for (const { curve, row } of rows.lanes) {
    const value = /** @type {number|null} */ (columns?.[curve.key][index] ?? null);
    label(ctx, curve.label, value === null ? DASH : said(curve, value), row, edge, ui("text"));
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

/** Put the cursor onto a frame; out of sight when that is not shown. @param {HTMLElement} cursor @param {import("./span.js").Span} span @param {number} index */
export function moveCursor(cursor, span, index) {
  const x = Math.round(span.middle(index));
  cursor.hidden = !span.holds(x);
  cursor.style.setProperty("--x", `${x}px`);
}
