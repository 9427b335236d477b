/** Events on the timeline: a flag each, and what their kinds are called. */
import { color, ui } from "../core/colors.js";

/** @typedef {import("../drive/types.js").DriveEvent} DriveEvent */

/** @type {Record<string, string>} */
const NAMES = {
  first_acquisition: "First acquisition", cipv_switch: "CIPV switch", cipv_lost: "CIPV lost", cut_in: "Cut-in", cut_out: "Cut-out",
  ttc_minimum: "TTC minimum", warning: "Warning", brake: "Brake", vl_disagreement: "V–L disagreement", sensor_gap: "Sensor gap", mark: "Mark",
};

/** @param {DriveEvent} event */
export const nameOf = ({ kind }) => NAMES[kind] ?? kind.replaceAll("_", " ");

/** @param {DriveEvent} event the colour of its severity; marks have their own */
export function tintOf({ kind, severity }) {
  if (kind === "mark") return ui("accent");
  return { info: color("cipv"), notice: color("path"), warning: ui("warn"), alarm: ui("danger") }[severity];
}

/** @param {CanvasRenderingContext2D} ctx @param {import("./span.js").Span} span @param {{top: number, height: number}} row @param {DriveEvent[]} events */
export function drawFlags(ctx, span, row, events) {
  for (const event of events) {
    const x = span.middle(event.index), { top, height } = row;
    if (!span.holds(x)) continue;
    ctx.fillStyle = tintOf(event);
    ctx.fillRect(x - 0.5, top, 1, height + 2);
    ctx.beginPath();
    ctx.moveTo(x, top + 1);
    ctx.lineTo(x + 8, top + 4.5);
    ctx.lineTo(x, top + 8);
    ctx.fill();
  }
}

/** The event whose flag is under a pixel column. @param {DriveEvent[]} events @param {import("./span.js").Span} span @param {number} x */
export function flagAt(events, span, x) {
  const REACH_PX = 9;
  const near = events.map((event) => ({ event, away: Math.abs(span.middle(event.index) + 3 - x) })).filter(({ away }) => away <= REACH_PX);
  return near.sort((a, b) => a.away - b.away)[0]?.event ?? null;
}
