/** The CIPV of each frame in the current run. A click selects it. */
import { ui } from "../../core/colors.js";
import { DASH } from "../../core/format.js";
import { get, set } from "../../core/store.js";
import { colorOf, drawRibbon } from "./lead_ribbon.js";

/** @typedef {import("../../drive/types.js").Series} Series */
/** @typedef {import("../span.js").Span} Span */
/** @typedef {import("./registry.js").Place} Place */

/** @type {import("./registry.js").Lane} */
export const lead = {
  key: "lead",
  height: () => 16,
  isRuled: true,
  draw(ctx, place) {
    const run = get("drive")?.now;
    if (!run) return;
    drawRibbon(ctx, run, place);
    drawPending(ctx, place, run.done);
  },
  label: (index, isLight) => leadLabel(get("labeling")?.on ? "pipeline" : "CIPV", get("drive")?.now, index, isLight),
  click: (span, x) => selectLead(get("drive")?.now, span.index(x)),
};

/**
 * A line over the frames that are not computed yet.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Place} place
 * @param {number} done
 */
function drawPending(ctx, { span, row }, done) {
  if (done >= span.count) return;
  const x = Math.max(span.left, span.x(done)),
    y = row.top + row.height / 2;
  ctx.strokeStyle = ui("line");
  ctx.lineWidth = 1;
  ctx.beginPath();
  ctx.moveTo(x, y);
  ctx.lineTo(span.left + span.width, y);
  ctx.stroke();
}

/**
 * Name of the lane, and the CIPV's id at a frame.
 * @param {string} name @param {Series|null|undefined} run @param {number} index @param {boolean} isLight
 * @returns {import("./registry.js").Label}
 */
export function leadLabel(name, run, index, isLight) {
  const id = run?.columns.cipv_id[index] ?? null;
  return { name, value: id === null ? DASH : `#${id}`, tint: id === null ? ui("dim") : colorOf(id, isLight) };
}

/** @param {Series|null|undefined} run @param {number} index */
export function selectLead(run, index) {
  const id = run?.columns.cipv_id[index] ?? null;
  if (id !== null) set("selection", id);
}
