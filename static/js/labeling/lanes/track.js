/** Extent of the selected track, with its keyframes. */
import { color, ui } from "../../core/colors.js";
import { get } from "../../core/store.js";
import { chosen } from "../state/labels.js";

/** @typedef {import("../../timeline/span.js").Span} Span */
/** @typedef {import("../../timeline/rows.js").Row} Row */

/** @type {import("../../timeline/lanes/registry.js").Lane} */
export const track = {
  key: "label-track",
  height: () => (get("labeling")?.on ? 9 : 0),
  redrawOn: ["track"],
  draw: (ctx, { span, row }) => drawTrack(ctx, span, row),
};

/** @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row */
function drawTrack(ctx, span, row) {
  const track = chosen();
  if (!track || track.first === null || track.last === null) return;
  const x = span.x(track.first);
  ctx.fillStyle = color("fused");
  ctx.globalAlpha = 0.45;
  ctx.fillRect(x, row.top + 2, Math.max(2, span.x(track.last + 1) - x), row.height - 4);
  ctx.globalAlpha = 1;
  ctx.fillStyle = ui("text");
  for (const frame of track.keyframes) {
    if (frame < span.first - 1 || frame > span.end) continue;
    ctx.fillRect(Math.round(span.middle(frame)) - 1, row.top, 2, row.height);
  }
}
