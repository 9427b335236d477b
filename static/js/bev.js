/** The plan view: ego frame from above, x up and y left, in metres. */
import { color, onPicture, roleOf, ui } from "./colors.js";
import { $, fitted } from "./dom.js";
import { num } from "./format.js";
import { Labels } from "./labels.js";
import { DotRaster, rgba } from "./raster.js";
import { get, paint, select } from "./store.js";
import { Viewport } from "./viewport.js";

const RINGS_M = [10, 20, 30, 40, 50, 60, 70, 80, 100, 120];
const KIND_ROLES = ["ground", "unclustered", "cluster", "dropped"];
const CLUSTER = 2;

const PICK_PX = 8;

const canvas = $("#bev");
const raster = new DotRaster();
/** @type {Viewport} */
let view;
const U = (y) => view.u(y);
const V = (x) => view.v(x);

export function setUp() {
  const invalidate = paint(["frame", "layers", "selection", "theme"], draw);
  view = new Viewport(canvas, invalidate, (place) => select(objectAt(place)));
  new ResizeObserver(invalidate).observe(canvas);
}

function draw() {
  const { ctx, width, height } = fitted(canvas);
  view.resize({ width, height });
  drawGrid(ctx);
  const frame = get("frame");
  if (frame) {
    const layers = get("layers");
    if (layers.planPath) drawPath(ctx, frame.result.path);
    if (layers.planPoints) drawPoints(ctx, frame, { width, height });
    drawObjects(ctx, frame, layers);
  }
  drawEgo(ctx);
}

function drawGrid(ctx) {
  ctx.strokeStyle = color("grid");
  ctx.fillStyle = ui("dim");
  ctx.lineWidth = 1;
  ctx.font = "10px system-ui, sans-serif";
  for (const r of RINGS_M) {
    ctx.beginPath();
    ctx.arc(U(0), V(0), r * view.scale, Math.PI, 2 * Math.PI);
    ctx.stroke();
    const v = V(r);
    if (v > 12) ctx.fillText(`${r} m`, U(0) + 3, v - 3);
  }
  ctx.beginPath();
  ctx.moveTo(U(0), V(0));
  ctx.lineTo(U(0), 0);
  ctx.setLineDash([2, 5]);
  ctx.stroke();
  ctx.setLineDash([]);
}

function drawPath(ctx, path) {
  if (path.left.length < 2) return;
  ctx.beginPath();
  [...path.left, ...[...path.right].reverse()].forEach(([x, y], i) => (i ? ctx.lineTo(U(y), V(x)) : ctx.moveTo(U(y), V(x))));
  ctx.closePath();
  ctx.fillStyle = ctx.strokeStyle = color("path");
  ctx.globalAlpha = 0.13;
  ctx.fill();
  ctx.globalAlpha = 0.8;
  ctx.lineWidth = 1;
  for (const side of [path.left, path.right]) {
    ctx.beginPath();
    side.forEach(([x, y], i) => (i ? ctx.lineTo(U(y), V(x)) : ctx.moveTo(U(y), V(x))));
    ctx.stroke();
  }
  ctx.globalAlpha = 1;
}

/** Ground and loose points first, clusters over them in the colour of their object. */
function drawPoints(ctx, { count, xyz, kind, owner, result }, { width, height }) {
  const lead = result.cipv?.id ?? null;
  const tints = [rgba(color("cluster")), ...result.objects.map((item) => rgba(color(roleOf(item, lead))))];
  const loose = KIND_ROLES.map((role) => rgba(color(role), role === "unclustered" ? 0.8 : 0.55));
  raster.begin(width, height);
  for (const isCluster of [false, true]) {
    for (let i = 0; i < count; i++) {
      if ((kind[i] === CLUSTER) !== isCluster) continue;
      raster.dot(U(xyz[3 * i + 1] / 100), V(xyz[3 * i] / 100), isCluster ? 2 : 1, isCluster ? tints[owner[i]] : loose[kind[i]]);
    }
  }
  raster.drawOn(ctx);
}

function drawObjects(ctx, { result }, layers) {
  const lead = result.cipv?.id ?? null;
  const labels = new Labels(ctx);
  const chosen = get("selection");
  const important = (item) => item.id === lead || item.id === chosen;
  const order = [...result.objects].filter((item) => item.bev).sort((a, b) => Number(important(a)) - Number(important(b)));
  for (const item of order) {
    const tint = color(roleOf(item, lead));
    outline(ctx, item.bev);
    ctx.fillStyle = ctx.strokeStyle = tint;
    ctx.globalAlpha = item.id === lead ? 0.75 : item.carried ? 0.06 : 0.16;
    ctx.fill();
    ctx.globalAlpha = item.carried ? 0.6 : 1;
    ctx.lineWidth = important(item) ? 2.2 : 1.2;
    ctx.setLineDash(item.carried ? [3, 3] : []);
    ctx.stroke();
    ctx.setLineDash([]);
    if (item.source !== "L") sigma(ctx, item);
    ctx.globalAlpha = item.source === "L" && !important(item) ? 0.4 : 1;
    if (layers.velocity && item.velocity_mps && !item.carried) arrow(ctx, item);
    ctx.globalAlpha = 1;
    if (item.id === chosen) ring(ctx, item.bev);
  }
  for (const item of order.reverse()) {
    if (!important(item) && (item.carried || (item.source === "L" && !item.in_path))) continue;
    const u = Math.max(...item.bev.map(([, y]) => U(y))) + 3, v = Math.min(...item.bev.map(([x]) => V(x))) + 14;
    const distance = item.distance_m === null ? "" : ` ${num(item.distance_m)}`;
    labels.put(item.id === lead ? `CIPV #${item.id} ${distance} m` : `#${item.id}${distance}`, u, v, onPicture(roleOf(item, lead)), item.id === lead);
  }
}

function outline(ctx, corners) {
  ctx.beginPath();
  corners.forEach(([x, y], i) => (i ? ctx.lineTo(U(y), V(x)) : ctx.moveTo(U(y), V(x))));
  ctx.closePath();
}

/** One sigma of the distance, along the line of sight. */
function sigma(ctx, item) {
  if (!item.distance_sigma_m || !item.closest_point || item.distance_m < 0.1) return;
  const [x, y] = item.closest_point;
  const k = item.distance_sigma_m / Math.hypot(x, y);
  ctx.lineWidth = 1;
  ctx.beginPath();
  ctx.moveTo(U(y * (1 - k)), V(x * (1 - k)));
  ctx.lineTo(U(y * (1 + k)), V(x * (1 + k)));
  ctx.stroke();
}

function arrow(ctx, item) {
  const [vx, vy] = item.velocity_mps;
  if (Math.hypot(vx, vy) < 0.5) return;
  const cx = item.bev.reduce((s, p) => s + p[0], 0) / 4, cy = item.bev.reduce((s, p) => s + p[1], 0) / 4;
  const u0 = U(cy), v0 = V(cx), u1 = U(cy + vy), v1 = V(cx + vx);
  const turn = Math.atan2(v1 - v0, u1 - u0);
  ctx.lineWidth = 1.5;
  ctx.beginPath();
  ctx.moveTo(u0, v0);
  ctx.lineTo(u1, v1);
  for (const side of [-0.5, 0.5]) {
    ctx.moveTo(u1, v1);
    ctx.lineTo(u1 - 6 * Math.cos(turn + side), v1 - 6 * Math.sin(turn + side));
  }
  ctx.stroke();
}

function ring(ctx, corners) {
  const us = corners.map(([, y]) => U(y)), vs = corners.map(([x]) => V(x));
  ctx.strokeStyle = ui("text");
  ctx.lineWidth = 1.5;
  ctx.strokeRect(Math.min(...us) - 5, Math.min(...vs) - 5, Math.max(...us) - Math.min(...us) + 10, Math.max(...vs) - Math.min(...vs) + 10);
}

/** Our own car: the origin is at its front bumper or just behind it. */
function drawEgo(ctx) {
  const w = 1.8 * view.scale, l = 4.4 * view.scale;
  ctx.fillStyle = color("ego");
  ctx.globalAlpha = 0.9;
  ctx.beginPath();
  ctx.roundRect(U(0) - w / 2, V(0), w, l, Math.min(w / 3, 6));
  ctx.fill();
  ctx.globalAlpha = 1;
}

/** The object whose footprint is nearest to a place, within a few pixels. @param {{x: number, y: number}} place */
function objectAt(place) {
  let best = null;
  for (const item of get("frame")?.result.objects ?? []) {
    if (!item.bev) continue;
    const xs = item.bev.map((p) => p[0]), ys = item.bev.map((p) => p[1]);
    const dx = Math.max(Math.min(...xs) - place.x, 0, place.x - Math.max(...xs));
    const dy = Math.max(Math.min(...ys) - place.y, 0, place.y - Math.max(...ys));
    const away = Math.hypot(dx, dy) * view.scale;
    if (away < PICK_PX && (!best || away < best.away)) best = { id: item.id, away };
  }
  return best?.id ?? null;
}
