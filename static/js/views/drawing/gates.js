/** Draws the gates of the selected object in the views, with value and limit. */
import { num } from "../../core/format.js";
import { isTrackedByTwo } from "../../core/object_sources.js";
import { middle } from "./trails.js";

/** @typedef {import("../../core/types.js").FusedObject} FusedObject */
/** @typedef {import("../../core/types.js").Frame} Frame */
/** @typedef {import("../../core/types.js").Point2} Point2 */
/** @typedef {import("../../core/types.js").Gate} Gate */
/** @typedef {import("./text_labels.js").Labels} Labels */
/** @typedef {{u: (y: number) => number, v: (x: number) => number, scale: number}} Plan */

const PASSED = "#4ade80",
  FAILED = "#ff6b6b";
const TICK_PX = 7;

/** @param {Gate} gate */
const tintOf = (gate) => (gate.passed ? PASSED : FAILED);

/** @param {FusedObject} item @param {string} name */
const gateOf = (item, name) => item.gates.find((gate) => gate.name === name) ?? null;

/** The first failed gate of an object as text, or null. @param {FusedObject} item */
export function failedWords(item) {
  const gate = item.gates.find(({ passed }) => !passed);
  if (!gate) return null;
  const name = gate.name.replaceAll("_", " ");
  if (gate.value === null || gate.limit === null) return `✕ ${name}`;
  return `✕ ${name} ${num(gate.value, 2)}, limit ${num(gate.limit, 2)}`;
}

/**
 * In the camera view: the overlap of both sensors' boxes, and the first failed gate.
 * @param {CanvasRenderingContext2D} ctx @param {Frame} frame @param {FusedObject} item @param {Labels} labels
 * @param {(u: number) => number} X @param {(v: number) => number} Y
 */
export function drawInImage(ctx, { display }, item, labels, X, Y) {
  const vision = display.vision_boxes[item.id],
    lidar = display.lidar_boxes[item.id],
    iou = gateOf(item, "iou");
  if (vision && lidar && iou && iou.value !== null) {
    const x1 = Math.max(vision[0], lidar[0]),
      y1 = Math.max(vision[1], lidar[1]);
    const x2 = Math.min(vision[2], lidar[2]),
      y2 = Math.min(vision[3], lidar[3]);
    ctx.fillStyle = tintOf(iou);
    ctx.globalAlpha = 0.22;
    if (x2 > x1 && y2 > y1) ctx.fillRect(X(x1), Y(y1), X(x2) - X(x1), Y(y2) - Y(y1));
    ctx.globalAlpha = 1;
    const below = Y(Math.max(vision[3], lidar[3])) + 20;
    labels.put(
      `IoU ${num(iou.value, 2)} ${iou.passed ? "≥" : "<"} ${num(iou.limit, 2)}`,
      X(Math.min(vision[0], lidar[0])),
      below,
      tintOf(iou),
      "must",
    );
  }
  const words = failedWords(item),
    anchor = vision ?? lidar;
  if (words && anchor) labels.put(words, X(anchor[0]), Y(anchor[3]) + 20, FAILED, "must");
}

/**
 * In the plan view: the path offset with its limit, and the camera-only range estimate.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Frame} frame
 * @param {FusedObject} item
 * @param {Labels} labels
 * @param {Plan} plan
 */
export function drawInPlan(ctx, { result, display }, item, labels, plan) {
  drawOffset(ctx, result.path.center, item, labels, plan);
  drawRange(ctx, item, display.vision_ranges[item.id], labels, plan);
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {Point2[]} center
 * @param {FusedObject} item
 * @param {Labels} labels
 * @param {Plan} plan
 */
function drawOffset(ctx, center, item, labels, plan) {
  const gate = gateOf(item, "path_offset");
  if (!gate || gate.limit === null || item.path_offset_m === null || !item.bev || center.length < 2) return;
  const { foot, left } = footOf(center, middle(item.bev));
  const side = Math.sign(item.path_offset_m) || 1;
  /** @param {number} offset @returns {[number, number]} */
  const at = (offset) => [plan.u(foot[1] + left[1] * offset), plan.v(foot[0] + left[0] * offset)];
  ctx.strokeStyle = tintOf(gate);
  ctx.lineWidth = 2;
  line(ctx, at(0), at(item.path_offset_m));
  for (const offset of [0, item.path_offset_m]) tick(ctx, at(offset), left, TICK_PX);
  ctx.setLineDash([3, 3]);
  tick(ctx, at(side * gate.limit), left, 2.4 * TICK_PX);
  ctx.setLineDash([]);
  const [u, v] = at(item.path_offset_m / 2);
  labels.put(`${num(Math.abs(item.path_offset_m), 2)} m, limit ${num(gate.limit, 2)}`, u, v + 22, tintOf(gate), "must");
}

/**
 * The range band that the gate accepts around the camera's estimate.
 * @param {CanvasRenderingContext2D} ctx
 * @param {FusedObject} item
 * @param {{distance_m: number, sigma_m: number}|undefined} seen
 * @param {Labels} labels
 * @param {Plan} plan
 */
function drawRange(ctx, item, seen, labels, plan) {
  if (!seen || !item.closest_point || !isTrackedByTwo(item)) return;
  const gate = gateOf(item, "range_sigmas"),
    [x, y] = item.closest_point;
  const reach = seen.sigma_m * (gate?.limit ?? 1),
    bearing = Math.atan2(y, x),
    half = Math.max(0.04, 2.5 / Math.hypot(x, y));
  // on the canvas x is up and y is left: bearing b is the angle −π/2 − b
  const from = -Math.PI / 2 - bearing - half,
    to = -Math.PI / 2 - bearing + half;
  const tint = gate ? tintOf(gate) : "#22d3ee",
    u = plan.u(0),
    v = plan.v(0);
  ctx.beginPath();
  ctx.arc(u, v, Math.max(0, seen.distance_m - reach) * plan.scale, from, to);
  ctx.arc(u, v, (seen.distance_m + reach) * plan.scale, to, from, true);
  ctx.closePath();
  ctx.fillStyle = ctx.strokeStyle = tint;
  ctx.globalAlpha = 0.12;
  ctx.fill();
  ctx.globalAlpha = 0.9;
  ctx.lineWidth = 1;
  ctx.stroke();
  ctx.beginPath();
  ctx.arc(u, v, seen.distance_m * plan.scale, from, to);
  ctx.setLineDash([4, 3]);
  ctx.stroke();
  ctx.setLineDash([]);
  ctx.globalAlpha = 1;
  const words = `camera ${num(seen.distance_m)} ± ${num(seen.sigma_m)} m`;
  const tested = gate && gate.value !== null ? `${words}: ${num(gate.value, 1)} σ, limit ${num(gate.limit, 1)}` : words;
  const far = seen.distance_m + reach;
  labels.put(tested, plan.u(far * Math.sin(bearing)) + 8, plan.v(far * Math.cos(bearing)), tint, "must");
}

/**
 * The nearest point of the path, and the unit vector to its left.
 * @param {Point2[]} center
 * @param {Point2} place
 * @returns {{foot: Point2, left: Point2}}
 */
function footOf(center, [px, py]) {
  let best = { away: Infinity, foot: center[0], left: /** @type {Point2} */ ([0, 1]) };
  for (let i = 1; i < center.length; i++) {
    const [ax, ay] = center[i - 1],
      dx = center[i][0] - ax,
      dy = center[i][1] - ay,
      length = Math.hypot(dx, dy);
    if (length === 0) continue;
    const share = Math.min(1, Math.max(0, ((px - ax) * dx + (py - ay) * dy) / length ** 2));
    const foot = /** @type {Point2} */ ([ax + share * dx, ay + share * dy]),
      away = Math.hypot(px - foot[0], py - foot[1]);
    if (away < best.away) best = { away, foot, left: [-dy / length, dx / length] };
  }
  return best;
}

/** @param {CanvasRenderingContext2D} ctx @param {[number, number]} a @param {[number, number]} b */
function line(ctx, [x1, y1], [x2, y2]) {
  ctx.beginPath();
  ctx.moveTo(x1, y1);
  ctx.lineTo(x2, y2);
  ctx.stroke();
}

/**
 * A tick mark along the path direction.
 * @param {CanvasRenderingContext2D} ctx
 * @param {[number, number]} at
 * @param {Point2} left
 * @param {number} half pixels
 */
function tick(ctx, [u, v], [lx, ly], half) {
  // along the path is the left direction turned back by a quarter: ego (ly, −lx), on the canvas (lx, −ly)
  line(ctx, [u - lx * half, v + ly * half], [u + lx * half, v - ly * half]);
}
