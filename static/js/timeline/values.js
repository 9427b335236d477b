/**
 * The parts that change with the frame: lane names with current values, and the cursor. They have their own small
 * canvas, since they are redrawn ten times a second.
 */
import { ui } from "../core/colors.js";

/** @typedef {import("./rows.js").Rows} Rows */

const LABEL = '10.5px system-ui, "DejaVu Sans", sans-serif';
const VALUE = '600 10.5px system-ui, "DejaVu Sans", sans-serif';

/**
 * Names at the left, and the values at a frame; of the time axis, its unit.
 * @param {CanvasRenderingContext2D} ctx @param {Rows} rows @param {number} index @param {boolean} isLight
 * @param {number} edge where the plot begins, CSS pixels
 */
export function drawValues(ctx, rows, index, isLight, edge) {
  ctx.textBaseline = "middle";
  label(ctx, { name: "Time", value: "min:s", tint: ui("dim") }, rows.axis, edge);
  for (const { lane, row } of rows.lanes) {
    const said = lane.label?.(index, isLight);
    if (said) label(ctx, said, row, edge);
  }
  ctx.textAlign = "start";
  ctx.textBaseline = "alphabetic";
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {import("./lanes/registry.js").Label} said
 * @param {import("./rows.js").Row} row
 * @param {number} edge
 */
function label(ctx, { name, value, tint }, row, edge) {
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

/**
 * Move the cursor to a frame; hidden if that is out of view.
 * @param {HTMLElement} cursor
 * @param {import("./span.js").Span} span
 * @param {number} index
 */
export function moveCursor(cursor, span, index) {
  const x = Math.round(span.middle(index));
  cursor.hidden = !span.holds(x);
  cursor.style.setProperty("--x", `${x}px`);
}
