/**
 * Plan view of the road ahead: ego path, vehicles, the lead and what ACC reacts to, clamped to the edge when out of
 * range.
 */
import { color } from "../js/core/colors.js";
import { $ } from "../js/core/dom.js";
import { isImaged } from "../js/core/object_sources.js";
import { drawOutline, drawPath } from "../js/views/drawing/plan.js";
import { get, paint } from "../js/core/store.js";
import { Surface } from "../js/views/drawing/surface.js";
import { middle } from "../js/views/drawing/trails.js";
import { isAlarmed, reactsTo } from "./acc.js";

const FROM_M = -6,
  TO_M = 64,
  RINGS_M = [20, 40, 60],
  EDGE_PX = 14,
  ALARM = "#f0484e";
const canvas = $("#plan", HTMLCanvasElement);
/** @type {Surface} */
let surface;

export function setUp() {
  surface = new Surface(canvas, paint(["frame", "theme"], draw));
}

function draw() {
  if (surface.isHidden) return;
  const ctx = surface.begin(),
    frame = get("frame");
  const scale = surface.height / (TO_M - FROM_M);
  const view = {
    scale,
    u: (/** @type {number} */ y) => surface.width / 2 - y * scale,
    v: (/** @type {number} */ x) => (TO_M - x) * scale,
  };
  drawRings(ctx, view);
  if (frame) {
    const { result } = frame,
      lead = result.cipv?.id ?? null,
      acted = reactsTo(result);
    drawPath(ctx, view, result.path);
    const important = (/** @type {number} */ id) => id === lead || id === acted;
    for (const item of [...result.objects].sort((a, b) => Number(important(a.id)) - Number(important(b.id)))) {
      if (!item.bev || !(important(item.id) || isImaged(item) || item.in_path)) continue;
      const tint =
        item.id === acted && isAlarmed(result)
          ? ALARM
          : item.id === lead
            ? color("cipv")
            : item.id === acted
              ? color("warning")
              : color("fused");
      ctx.fillStyle = ctx.strokeStyle = tint;
      drawOutline(ctx, view, item, important(item.id), important(item.id));
      if (important(item.id)) drawMarker(ctx, view.u(middle(item.bev)[1]), view.v(middle(item.bev)[0]));
    }
  }
  drawEgo(ctx, view);
}

/** @typedef {{scale: number, u: (y: number) => number, v: (x: number) => number}} View */

/** @param {CanvasRenderingContext2D} ctx @param {View} view */
function drawRings(ctx, view) {
  ctx.strokeStyle = color("grid");
  ctx.fillStyle = color("ground");
  ctx.font = "600 13px system-ui, sans-serif";
  ctx.lineWidth = 1;
  for (const range_m of RINGS_M) {
    ctx.beginPath();
    ctx.arc(view.u(0), view.v(0), range_m * view.scale, Math.PI, 2 * Math.PI);
    ctx.stroke();
    ctx.fillText(String(range_m), 6, view.v(range_m) + 16);
  }
}

/**
 * A ring of visible size, or a dot at the edge for objects out of range.
 * @param {CanvasRenderingContext2D} ctx
 * @param {number} u
 * @param {number} v
 */
function drawMarker(ctx, u, v) {
  const x = Math.max(EDGE_PX, Math.min(surface.width - EDGE_PX, u)),
    y = Math.max(EDGE_PX, Math.min(surface.height - EDGE_PX, v));
  ctx.lineWidth = 3;
  ctx.beginPath();
  ctx.arc(x, y, x === u && y === v ? EDGE_PX : EDGE_PX / 2, 0, 2 * Math.PI);
  if (x === u && y === v) ctx.stroke();
  else ctx.fill();
}

/** @param {CanvasRenderingContext2D} ctx @param {View} view */
function drawEgo(ctx, view) {
  const width = Math.max(10, 1.8 * view.scale),
    length = Math.max(20, 4.4 * view.scale);
  ctx.fillStyle = color("ego");
  ctx.beginPath();
  ctx.roundRect(view.u(0) - width / 2, view.v(0), width, length, 4);
  ctx.fill();
}
