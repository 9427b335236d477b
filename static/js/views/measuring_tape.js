/** The measuring tape between two places. In the camera view it snaps to LiDAR points. */
import { num } from "../core/format.js";
import { get, set } from "../core/store.js";

/**
 * @typedef {{x: number, y: number, z: number|null, u: number|null, v: number|null}} Spot ego metres; u, v: image pixels
 *   if set in the camera view
 */
/** @typedef {{from: Spot, to: Spot, frame: number}} Tape */

const TINT = "#ffd84d";
const CAP_PX = 4;

export function toggleTape() {
  const on = !get("taping");
  set("taping", on);
  if (!on) set("tape", null);
}

/** @param {Spot} from @param {Spot} to */
export function measure(from, to) {
  set("tape", { from, to, frame: get("frame")?.state.sequence ?? 0 });
}

/** "12.34 m (… along, … across)". @param {Tape} tape */
export function tapeWords({ from, to }) {
  const along = to.x - from.x,
    left = to.y - from.y,
    up = from.z === null || to.z === null ? 0 : to.z - from.z;
  const parts = [`${num(Math.abs(along), 2)} along`, `${num(Math.abs(left), 2)} across`];
  if (from.z !== null && to.z !== null) parts.push(`${num(Math.abs(up), 2)} up`);
  return `${num(Math.hypot(along, left, up), 2)} m  (${parts.join(", ")})`;
}

/**
 * @param {CanvasRenderingContext2D} ctx @param {[number, number]} a @param {[number, number]} b pixels of the canvas
 * @param {Tape} tape @param {import("./drawing/text_labels.js").Labels} labels
 */
export function drawTape(ctx, [x1, y1], [x2, y2], tape, labels) {
  const length = Math.hypot(x2 - x1, y2 - y1) || 1,
    nx = (-(y2 - y1) / length) * CAP_PX,
    ny = ((x2 - x1) / length) * CAP_PX;
  for (const [tint, width] of /** @type {[string, number][]} */ ([
    ["rgb(0 0 0 / .7)", 4],
    [TINT, 1.8],
  ])) {
    ctx.strokeStyle = tint;
    ctx.lineWidth = width;
    ctx.beginPath();
    ctx.moveTo(x1, y1);
    ctx.lineTo(x2, y2);
    for (const [x, y] of [
      [x1, y1],
      [x2, y2],
    ]) {
      ctx.moveTo(x - nx, y - ny);
      ctx.lineTo(x + nx, y + ny);
    }
    ctx.stroke();
  }
  labels.put(tapeWords(tape), (x1 + x2) / 2 + 6, (y1 + y2) / 2, TINT, "must");
}
