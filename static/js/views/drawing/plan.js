/** Drawing functions of the plan view. */
import { color } from "../../core/colors.js";
import { middle, trailOf } from "./trails.js";

/** @typedef {import("../../core/types.js").Point2} Point2 */
/** @typedef {import("../../core/types.js").FusedObject} FusedObject */
/**
 * Maps ego coordinates to canvas pixels.
 * @typedef {Pick<import("./viewport.js").Viewport, "u"|"v"|"scale">} Viewport
 */

const SLOWEST_MPS = 0.5,
  HEAD_PX = 6;

/** @param {CanvasRenderingContext2D} ctx @param {Viewport} view @param {Point2[]} line */
export function trace(ctx, view, line) {
  ctx.beginPath();
  line.forEach(([x, y], i) => (i ? ctx.lineTo(view.u(y), view.v(x)) : ctx.moveTo(view.u(y), view.v(x))));
}

/**
 * The path corridor, with 1σ around its edges.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Viewport} view
 * @param {import("../../core/types.js").Path} path
 */
export function drawPath(ctx, view, path) {
  if (path.left.length < 2) return;
  ctx.fillStyle = ctx.strokeStyle = color("path");
  const sigma = sigmaAlong(path.sigma_m);
  ctx.globalAlpha = 0.1;
  for (const side of [path.left, path.right]) {
    const moved = (/** @type {number} */ sign) =>
      side.map(([x, y]) => /** @type {Point2} */ ([x, y + sign * sigma(x)]));
    trace(ctx, view, [...moved(1), ...moved(-1).reverse()]);
    ctx.closePath();
    ctx.fill();
  }
  trace(ctx, view, [...path.left, ...[...path.right].reverse()]);
  ctx.closePath();
  ctx.globalAlpha = 0.13;
  ctx.fill();
  ctx.globalAlpha = 0.8;
  ctx.lineWidth = 1;
  for (const side of [path.left, path.right]) {
    trace(ctx, view, side);
    ctx.stroke();
  }
  ctx.globalAlpha = 0.45;
  ctx.setLineDash([6, 6]);
  trace(ctx, view, path.center);
  ctx.stroke();
  ctx.setLineDash([]);
  ctx.globalAlpha = 1;
}

/** Interpolated lateral standard deviation of the path at a distance ahead.
 * @param {Record<string, number|null>} sigmas @returns {(x: number) => number} */
function sigmaAlong(sigmas) {
  const known = Object.entries(sigmas)
    .flatMap(([at, sigma]) => (sigma === null ? [] : [[Number(at), sigma]]))
    .sort(([a], [b]) => a - b);
  if (!known.length) return () => 0;
  return (x) => {
    const after = known.findIndex(([at]) => at >= x);
    if (after === 0) return known[0][1];
    if (after < 0) return known[known.length - 1][1];
    const [x0, s0] = known[after - 1],
      [x1, s1] = known[after];
    return s0 + ((s1 - s0) * (x - x0)) / (x1 - x0);
  };
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {Viewport} view
 * @param {FusedObject} item
 * @param {boolean} isImportant
 * @param {boolean} isLead
 */
export function drawOutline(ctx, view, item, isImportant, isLead) {
  if (!item.bev) return;
  trace(ctx, view, item.bev);
  ctx.closePath();
  ctx.globalAlpha = isLead ? 0.75 : item.carried ? 0.06 : 0.16;
  ctx.fill();
  ctx.globalAlpha = item.carried ? 0.6 : 1;
  ctx.lineWidth = isImportant ? 2.2 : 1.2;
  ctx.setLineDash(item.carried ? [3, 3] : []);
  ctx.stroke();
  ctx.setLineDash([]);
}

/**
 * ±1σ of the distance, along the line of sight.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Viewport} view
 * @param {FusedObject} item
 */
export function drawSigma(ctx, view, item) {
  if (!item.distance_sigma_m || !item.closest_point || (item.distance_m ?? 0) < 0.1) return;
  const [x, y] = item.closest_point,
    share = item.distance_sigma_m / Math.hypot(x, y);
  ctx.lineWidth = 1;
  trace(ctx, view, [
    [x * (1 - share), y * (1 - share)],
    [x * (1 + share), y * (1 + share)],
  ]);
  ctx.stroke();
}

/**
 * Relative motion over the next second.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Viewport} view
 * @param {FusedObject} item
 */
export function drawArrow(ctx, view, item) {
  if (!item.velocity_mps || !item.bev) return;
  const [vx, vy] = item.velocity_mps,
    [x, y] = middle(item.bev);
  if (Math.hypot(vx, vy) < SLOWEST_MPS) return;
  const u0 = view.u(y),
    v0 = view.v(x),
    u1 = view.u(y + vy),
    v1 = view.v(x + vx),
    turn = Math.atan2(v1 - v0, u1 - u0);
  ctx.lineWidth = 1.5;
  ctx.beginPath();
  ctx.moveTo(u0, v0);
  ctx.lineTo(u1, v1);
  for (const side of [-0.5, 0.5]) {
    ctx.moveTo(u1, v1);
    ctx.lineTo(u1 - HEAD_PX * Math.cos(turn + side), v1 - HEAD_PX * Math.sin(turn + side));
  }
  ctx.stroke();
}

/**
 * A trail that fades towards the past.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Viewport} view
 * @param {number} id
 * @param {string} tint
 */
export function drawTrail(ctx, view, id, tint) {
  const trail = trailOf(id);
  ctx.strokeStyle = tint;
  ctx.lineWidth = 2;
  for (let i = 1; i < trail.length; i++) {
    ctx.globalAlpha = (0.75 * i) / trail.length;
    trace(ctx, view, [trail[i - 1], trail[i]]);
    ctx.stroke();
  }
  ctx.globalAlpha = 1;
}

/**
 * A rectangle around an object.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Viewport} view
 * @param {FusedObject} item
 * @param {string} tint
 * @param {number[]} [dash]
 */
export function drawRing(ctx, view, { bev }, tint, dash = []) {
  if (!bev) return;
  const us = bev.map(([, y]) => view.u(y)),
    vs = bev.map(([x]) => view.v(x)),
    left = Math.min(...us),
    top = Math.min(...vs);
  ctx.strokeStyle = tint;
  ctx.lineWidth = 1.5;
  ctx.setLineDash(dash);
  ctx.strokeRect(left - 5, top - 5, Math.max(...us) - left + 10, Math.max(...vs) - top + 10);
  ctx.setLineDash([]);
}

/**
 * The headings of other vehicles that the path follows, as a dash of two metres each.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Viewport} view
 * @param {[number, number, number][]} headings
 */
export function drawTraffic(ctx, view, headings) {
  ctx.strokeStyle = color("path");
  ctx.lineWidth = 2;
  ctx.beginPath();
  for (const [x, y, heading] of headings) {
    const dx = Math.cos(heading),
      dy = Math.sin(heading);
    ctx.moveTo(view.u(y - dy), view.v(x - dx));
    ctx.lineTo(view.u(y + dy), view.v(x + dx));
  }
  ctx.stroke();
}
