/** The plan view: the ego frame from above, x up and y left, in metres. */
import { color, roleOf, ui } from "../core/colors.js";
import { $, el, press } from "../core/dom.js";
import { isImaged } from "../core/object_sources.js";
import { drawInPlan } from "./drawing/gates.js";
import { followHover } from "./hover.js";
import { Labels } from "./drawing/text_labels.js";
import { addTool } from "./layers.js";
import { nearestPoint, ownerOf } from "./drawing/hit_test.js";
import { drawArrow, drawOutline, drawPath, drawRing, drawSigma } from "./drawing/plan.js";
import { drawTraffic, drawTrail, trace } from "./drawing/plan.js";
import { drawTags } from "./drawing/plan_tags.js";
import { CLUSTER, tints } from "./drawing/point_colors.js";
import { DotRaster } from "./drawing/dot_raster.js";
import { get, paint, select, set } from "../core/store.js";
import { Surface } from "./drawing/surface.js";
import { drawTape, measure } from "./measuring_tape.js";
import { Viewport } from "./drawing/viewport.js";

/** @typedef {import("../core/types.js").Frame} Frame */
/** @typedef {import("../core/types.js").FusedObject} FusedObject */
/** @typedef {import("./drawing/viewport.js").Place} Place */
/** @typedef {import("./drawing/viewport.js").Drag} Drag */

const RINGS_M = [10, 20, 30, 40, 50, 60, 70, 80, 100, 120];
const PICK_PX = 8;

const canvas = $("#bev", HTMLCanvasElement);
const raster = new DotRaster();
/** @type {Surface} */
let surface;
/** @type {Viewport} */
let view;
/**
 * A mode that draws over the plan view and handles its pointer input first.
 * @typedef
 *   {{isOn: () => boolean, draw: (ctx: CanvasRenderingContext2D, view: Viewport, labels: Labels) => void, takes:
 *   (from: Place, scale: number) => Drag|null, clicked: (place: Place) => void, cursorAt: (place: Place, scale:
 *   number) => string}}
 *   PlanMode
 */
/** @type {PlanMode|null} */
let mode = null;

/** @param {PlanMode} added */
export function addMode(added) {
  mode = added;
}

/** The active mode, or null. */
const modeNow = () => (mode?.isOn() ? mode : null);

export function setUp() {
  const invalidate = paint(
    [
      "frame",
      "layers",
      "colorBy",
      "selection",
      "theme",
      "tape",
      "labeling",
      "labels",
      "labelFrames",
      "track",
      "draft",
      "drawnPath",
      "threshold",
    ],
    draw,
  );
  surface = new Surface(canvas, invalidate, "panel");
  view = new Viewport(canvas, {
    changed: () => {
      reflect();
      invalidate();
    },
    clicked: (place) =>
      get("taping") ? set("tape", null) : modeNow() ? modeNow()?.clicked(place) : select(objectAt(place)),
    hasKeys: () => !modeNow(),
    takes: (from, event) =>
      get("taping") || event.shiftKey ? measuring(from) : (modeNow()?.takes(from, view.scale) ?? null),
  });
  followHover(
    canvas,
    (u, v) => (modeNow() ? null : objectAt(view.place(u, v))),
    (u, v) => modeNow()?.cursorAt(view.place(u, v), view.scale) ?? "",
  );
  const views = /** @type {const} */ ([
    ["ahead", "Ahead", "View the road ahead (double-click)"],
    ["around", "Around", "View 50 m in every direction"],
  ]);
  for (const [name, label, title] of views)
    addTool(
      "plan",
      el("button", { type: "button", textContent: label, title, data: { view: name }, onclick: () => view.show(name) }),
    );
  reflect();
}

/** @param {Place} from @returns {Drag} */
const measuring = (from) => ({
  moved: (to) => measure({ ...from, z: null, u: null, v: null }, { ...to, z: null, u: null, v: null }),
});

function reflect() {
  for (const button of document.querySelectorAll(".view-tools [data-view]"))
    press(button, /** @type {HTMLElement} */ (button).dataset.view === view.view);
}

function draw() {
  if (surface.isHidden) return;
  const ctx = surface.begin(),
    frame = get("frame"),
    layers = get("layers") ?? {};
  view.resize(surface);
  drawGrid(ctx);
  const labels = new Labels(ctx, surface.width);
  if (frame) {
    if (layers.planPath) drawPath(ctx, view, frame.result.path);
    if (layers.planPoints) drawPoints(ctx, frame);
    if (layers.planPath && frame.display.plan_lanes) drawLanes(ctx, frame.display.plan_lanes);
    if (layers.planPath && frame.display.plan_edges) drawEdges(ctx, frame.display.plan_edges, "path");
    if (layers.planPath && frame.display.plan_drivable) drawEdges(ctx, frame.display.plan_drivable, "lane");
    if (layers.planPath && frame.display.plan_traffic) drawTraffic(ctx, view, frame.display.plan_traffic);
    if (!modeNow() || get("labeling")?.hasObjects) drawObjects(ctx, frame, layers, labels);
    modeNow()?.draw(ctx, view, labels);
  }
  drawEgo(ctx);
  const tape = get("tape");
  if (tape)
    drawTape(ctx, [view.u(tape.from.y), view.v(tape.from.x)], [view.u(tape.to.y), view.v(tape.to.x)], tape, labels);
}

/** @param {CanvasRenderingContext2D} ctx */
function drawGrid(ctx) {
  const u = view.u(0),
    v = view.v(0);
  ctx.strokeStyle = color("grid");
  ctx.fillStyle = ui("dim");
  ctx.lineWidth = 1;
  ctx.font = "10px system-ui, sans-serif";
  for (const r of RINGS_M) {
    ctx.beginPath();
    ctx.arc(u, v, r * view.scale, view.view === "around" ? 0 : Math.PI, 2 * Math.PI);
    ctx.stroke();
    const top = view.v(r);
    if (top > 12) ctx.fillText(`${r} m`, u + 3, top - 3);
  }
  ctx.beginPath();
  ctx.moveTo(u, v);
  ctx.lineTo(u, 0);
  ctx.setLineDash([2, 5]);
  ctx.stroke();
  ctx.setLineDash([]);
}

/**
 * Clusters are drawn last and larger.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Frame} frame
 */
function drawPoints(ctx, frame) {
  const { count, xyz, kind } = frame,
    colors = tints(frame, get("colorBy")?.plan ?? "object", color, 0.55);
  raster.begin(surface.width, surface.height);
  for (const isCluster of [false, true]) {
    const size = isCluster ? 2 : 1;
    for (let i = 0; i < count; i++) {
      if ((kind[i] === CLUSTER) === isCluster)
        raster.dot(view.u(xyz[3 * i + 1] / 100), view.v(xyz[3 * i] / 100), size, colors[i]);
    }
  }
  raster.drawOn(ctx);
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {{left: import("../core/types.js").Point2[], right: import("../core/types.js").Point2[]}} lanes
 */
function drawLanes(ctx, lanes) {
  ctx.strokeStyle = color("lane");
  ctx.lineWidth = 2;
  for (const line of [lanes.left, lanes.right]) {
    trace(ctx, view, line);
    ctx.stroke();
  }
}

/**
 * The road edges, or those of the drivable area, if the path is based on them.
 * @param {CanvasRenderingContext2D} ctx
 * @param {import("../core/types.js").Point2[]} cells
 * @param {"path"|"lane"} tint
 */
function drawEdges(ctx, cells, tint) {
  ctx.fillStyle = color(tint);
  for (const [x, y] of cells) ctx.fillRect(view.u(y) - 1, view.v(x) - 1, 3, 3);
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {Frame} frame
 * @param {Record<string, boolean>} layers
 * @param {Labels} labels
 */
function drawObjects(ctx, frame, layers, labels) {
  const { result } = frame,
    lead = result.cipv?.id ?? null,
    next = result.next_cipv?.id ?? null,
    chosen = get("selection");
  const important = (/** @type {FusedObject} */ item) => item.id === lead || item.id === chosen || item.id === next;
  const order = result.objects.filter((item) => item.bev).sort((a, b) => Number(important(a)) - Number(important(b)));
  for (const item of order) {
    const tint = color(roleOf(item, lead)),
      isNamed = important(item) || (!item.carried && (isImaged(item) || item.in_path));
    if (layers.trails && isNamed) drawTrail(ctx, view, item.id, tint);
    ctx.fillStyle = ctx.strokeStyle = tint;
    drawOutline(ctx, view, item, important(item), item.id === lead);
    if (isImaged(item)) drawSigma(ctx, view, item);
    ctx.globalAlpha = !isImaged(item) && !important(item) ? 0.4 : 1;
    if (layers.velocity && !item.carried) drawArrow(ctx, view, item);
    ctx.globalAlpha = 1;
    if (item.id === chosen) drawRing(ctx, view, item, ui("text"));
    if (item.id === next) drawRing(ctx, view, item, color("cipv"), [4, 4]);
  }
  const selected = order.find(({ id }) => id === chosen);
  if (selected)
    drawInPlan(ctx, frame, selected, labels, { u: (y) => view.u(y), v: (x) => view.v(x), scale: view.scale });
  drawTags(view, order, { lead, next, chosen }, labels);
}

/** The ego vehicle: the origin is at its front bumper or just behind it. @param {CanvasRenderingContext2D} ctx */
function drawEgo(ctx) {
  const w = 1.8 * view.scale,
    l = 4.4 * view.scale;
  ctx.fillStyle = color("ego");
  ctx.globalAlpha = 0.9;
  ctx.beginPath();
  ctx.roundRect(view.u(0) - w / 2, view.v(0), w, l, Math.min(w / 3, 6));
  ctx.fill();
  ctx.globalAlpha = 1;
}

/**
 * The object whose footprint or point is nearest to a place, within a few pixels.
 * @param {{x: number, y: number}} place
 */
function objectAt({ x, y }) {
  const frame = get("frame");
  if (!frame) return null;
  /** @type {{id: number, away: number}|null} */
  let best = null;
  for (const { id, bev } of frame.result.objects) {
    if (!bev) continue;
    const xs = bev.map((p) => p[0]),
      ys = bev.map((p) => p[1]);
    const dx = Math.max(Math.min(...xs) - x, 0, x - Math.max(...xs)),
      dy = Math.max(Math.min(...ys) - y, 0, y - Math.max(...ys));
    const away = Math.hypot(dx, dy) * view.scale;
    if (away < PICK_PX && (!best || away < best.away)) best = { id, away };
  }
  const { count, xyz, owner } = frame;
  return (
    best?.id ??
    ownerOf(
      frame,
      nearestPoint(
        count,
        (i) => owner[i] > 0,
        (i) => xyz[3 * i] / 100,
        (i) => xyz[3 * i + 1] / 100,
        x,
        y,
        PICK_PX / view.scale,
      ),
    )
  );
}
