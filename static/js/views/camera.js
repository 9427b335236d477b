/** The camera pane: the image with the pipeline's output as overlay. All projection is done by the server. */
import { onImage } from "../core/colors.js";
import { showImageAt } from "../core/connection.js";
import { $, text } from "../core/dom.js";
import { drawInImage } from "./drawing/gates.js";
import { num } from "../core/format.js";
import { followHover } from "./hover.js";
import { Labels } from "./drawing/text_labels.js";
import { drawBox, drawObjects, drawPath, drawWindow } from "./drawing/image.js";
import { ownerOf, pointAt } from "./drawing/hit_test.js";
import { GROUND, tints } from "./drawing/point_colors.js";
import { DotRaster } from "./drawing/dot_raster.js";
import { get, on, paint, select, set } from "../core/store.js";
import { placed, setUp as setUpZoom } from "./image_zoom.js";
import { Surface } from "./drawing/surface.js";
import { drawTape, measure } from "./measuring_tape.js";

/** @typedef {import("../core/types.js").Frame} Frame */
/** @typedef {{x: number, y: number, scale: number}} Place */
/** @typedef {(ctx: CanvasRenderingContext2D, frame: Frame, place: Place) => void} Layer */

const NBSP = "\u00a0";
/** From this zoom on, single pixels are shown. */
const SINGLE_PX = 3;
const PICK_PX = 8,
  HOLD_PX = 16;

const canvas = $("#camera", HTMLCanvasElement);
const raster = new DotRaster();
/** @type {Surface} */
let surface;
/** Position of the image in the pane. @type {Place} */
let laid = { x: 0, y: 0, scale: 1 };
/** Extra layers, below and above points and boxes. @type {{under: Layer[], over: Layer[]}} */
const extra = { under: [], over: [] };

/**
 * Add a layer to the camera image.
 * @param {Layer} draw
 * @param {keyof typeof extra} [where] below or above points and boxes
 */
export function addLayer(draw, where = "under") {
  extra[where].push(draw);
}

/** Position of the image: canvas pixel = x + u·scale, for a pixel u of the sent image. @returns {Place} */
export const place = () => laid;

const X = (/** @type {number} */ u) => laid.x + u * laid.scale;
const Y = (/** @type {number} */ v) => laid.y + v * laid.scale;

export function setUp() {
  const invalidate = paint(
    [
      "frame",
      "layers",
      "colorBy",
      "selection",
      "theme",
      "align",
      "tape",
      "labeling",
      "track",
      "draft",
      "projected",
      "pairs",
      "pairHover",
      "threshold",
    ],
    draw,
  );
  surface = new Surface(canvas, invalidate, "panel");
  showImageAt(canvas.clientWidth * devicePixelRatio); // at most as wide as its pane
  canvas.addEventListener(
    "click",
    (event) =>
      !get("align")?.on && !get("labeling")?.on && !get("taping") && select(objectAt(event.offsetX, event.offsetY)),
  );
  followHover(
    canvas,
    (u, v) => (get("align")?.on || get("labeling")?.on ? null : objectAt(u, v)),
    () => (get("labeling")?.tool ? "crosshair" : ""),
  );
  followTape();
  setUpZoom(canvas, () => surface, invalidate);
  on(["taping"], () => (canvas.style.cursor = get("taping") ? "crosshair" : ""));
}

function draw() {
  if (surface.isHidden) return;
  const frame = get("frame"),
    ctx = surface.begin();
  if (!frame) return;
  describe(frame);
  if (!frame.image) return message(ctx, "No camera image in this frame");
  layOut(frame.image);
  const { width, height } = frame.image;
  ctx.save();
  ctx.beginPath();
  ctx.rect(laid.x, laid.y, width * laid.scale, height * laid.scale);
  ctx.clip();
  const align = get("align"),
    blend = align?.on ? align.blend : null;
  if (blend !== null) ctx.globalAlpha = Math.min(1, 2 * (1 - blend));
  ctx.imageSmoothingEnabled = laid.scale < SINGLE_PX;
  if (frame.bitmap) ctx.drawImage(frame.bitmap, laid.x, laid.y, width * laid.scale, height * laid.scale);
  else message(ctx, "Could not decode the camera image of this frame");
  ctx.globalAlpha = 1;
  for (const layer of extra.under) layer(ctx, frame, laid);
  if (blend === null) drawBelief(ctx, frame);
  else {
    ctx.globalAlpha = Math.min(1, 2 * blend);
    drawPoints(ctx, frame);
    ctx.globalAlpha = 1;
  }
  for (const layer of extra.over) layer(ctx, frame, laid);
  ctx.restore();
}

/**
 * Name tags within the part of the image that is in view.
 * @param {CanvasRenderingContext2D} ctx @param {Frame} frame
 */
export function tagsIn(ctx, { image }) {
  const [width, height] = [image?.width ?? 0, image?.height ?? 0].map((side) => side * laid.scale);
  return new Labels(
    ctx,
    Math.min(surface.width, laid.x + width),
    Math.max(0, laid.y),
    Math.min(surface.height, laid.y + height),
  );
}

/** @param {CanvasRenderingContext2D} ctx @param {Frame} frame */
function drawBelief(ctx, frame) {
  const layers = get("layers") ?? {},
    { display, result } = frame;
  if (layers.path && display.path) drawPath(ctx, display.path, X, Y);
  const windows = layers.farView ? farViews(display) : [];
  for (const { window, tint } of windows) drawWindow(ctx, window, tint, X, Y);
  if (layers.points) drawPoints(ctx, frame);
  if (layers.lanes && display.lanes) for (const lane of [display.lanes.left, display.lanes.right]) drawLane(ctx, lane);
  const labels = tagsIn(ctx, frame);
  const hasObjects = !get("labeling")?.on || get("labeling")?.hasObjects;
  const chosen = hasObjects ? result.objects.find(({ id }) => id === get("selection")) : undefined;
  if (chosen) {
    for (const [boxes, role] of /** @type {const} */ ([
      [display.lidar_boxes, "lidar"],
      [display.vision_boxes, "vision"],
    ])) {
      if (boxes[chosen.id]) drawBox(ctx, boxes[chosen.id], onImage(role), 1.5, X, Y);
    }
  }
  if (hasObjects) drawObjects(ctx, frame, layers, labels, X, Y);
  if (chosen) drawInImage(ctx, frame, chosen, labels, X, Y);
  for (const { window, name, tint } of windows) labels.put(name, X(window[0]) + 3, Y(window[3]) - 3, tint);
  const tape = get("tape");
  if (tape?.from.u != null && tape.from.v != null && tape.to.u != null && tape.to.v != null) {
    drawTape(ctx, [X(tape.from.u), Y(tape.from.v)], [X(tape.to.u), Y(tape.to.v)], tape, labels);
  }
}

/** The windows that networks looked at in more detail. @param {import("../core/types.js").Display} display */
function farViews({ far_view: vehicles, lanes_far_view: lanes }) {
  return [
    ...(vehicles ? [{ window: vehicles, name: "far view", tint: onImage("vision") }] : []),
    ...(lanes ? [{ window: lanes, name: "far view of lanes", tint: onImage("lane") }] : []),
  ];
}

/** Fit the image into the pane, and the pane's default height to the image.
 * @param {{width: number, height: number}} image */
function layOut({ width, height }) {
  const aspect = (width / height).toFixed(3),
    workspace = $("#workspace");
  if (workspace.style.getPropertyValue("--aspect") !== aspect) workspace.style.setProperty("--aspect", aspect);
  laid = placed(surface, { width, height });
  const full = (get("frame")?.image?.full_width ?? width) + 1; // more pixels than the camera has show nothing more
  showImageAt(Math.min(width * laid.scale * surface.ratio, full));
}

/** @param {Frame} frame */
function describe({ result: { sensors }, image }) {
  const facts = image ? [`${image.full_width}×${image.full_height}`] : [];
  if (sensors.lidar?.points) facts.push(`${sensors.lidar.points.toLocaleString("en")} points`);
  if (sensors.camera?.skew_ms) facts.push(`camera skew ${num(sensors.camera.skew_ms, 0)} ms`);
  text($("#camera-facts"), facts.map((fact) => fact.replaceAll(" ", NBSP)).join(` ·${NBSP}`));
}

/** Ground points first, smaller and fainter. @param {CanvasRenderingContext2D} ctx @param {Frame} frame */
function drawPoints(ctx, frame) {
  const { count, uv, kind, image } = frame;
  if (!image) return;
  const { width, height } = image,
    { scale } = laid;
  const colors = tints(frame, get("colorBy")?.camera ?? "range", onImage, 0.7);
  const left = Math.max(0, laid.x),
    top = Math.max(0, laid.y);
  const right = Math.min(surface.width, laid.x + width * scale),
    bottom = Math.min(surface.height, laid.y + height * scale);
  raster.begin(right - left, bottom - top);
  const more = get("pairs")?.isOn ? 1 : 0; // points to be pressed are larger
  for (const isGround of [true, false]) {
    const size = (isGround ? 1 : 2) + more;
    for (let i = 0; i < count; i++) {
      const u = uv[2 * i],
        v = uv[2 * i + 1];
      if ((kind[i] === GROUND) === isGround && u >= 0 && v >= 0 && u < width && v < height)
        raster.dot(X(u) - left, Y(v) - top, size, colors[i]);
    }
  }
  raster.drawOn(ctx, left, top);
}

/** @param {CanvasRenderingContext2D} ctx @param {import("../core/types.js").Pixels} lane */
function drawLane(ctx, lane) {
  const seen = lane.filter((pixel) => pixel !== null);
  if (seen.length < 2) return;
  for (const [tint, width] of /** @type {[string, number][]} */ ([
    ["rgb(0 0 0 / .55)", 5],
    [onImage("lane"), 2.5],
  ])) {
    ctx.strokeStyle = tint;
    ctx.lineWidth = width;
    ctx.beginPath();
    seen.forEach(([u, v], i) => (i ? ctx.lineTo(X(u), Y(v)) : ctx.moveTo(X(u), Y(v))));
    ctx.stroke();
  }
}

/** @param {CanvasRenderingContext2D} ctx @param {string} words */
function message(ctx, words) {
  ctx.fillStyle = "#8a94a3";
  ctx.font = "13px system-ui, sans-serif";
  ctx.textAlign = "center";
  ctx.fillText(words, surface.width / 2, surface.height / 2);
  ctx.textAlign = "start";
}

/**
 * The smallest box under a pixel of the canvas, else the owner of the nearest point.
 * @param {number} px
 * @param {number} py
 */
function objectAt(px, py) {
  const frame = get("frame");
  if (!frame) return null;
  const u = (px - laid.x) / laid.scale,
    v = (py - laid.y) / laid.scale;
  const area = (/** @type {number[]} */ [x1, y1, x2, y2]) => (x2 - x1) * (y2 - y1);
  const hit = frame.result.objects
    .map(({ id }) => ({ id, box: frame.display.vision_boxes[id] ?? frame.display.lidar_boxes[id] }))
    .filter(({ box }) => box && u >= box[0] - 3 && u <= box[2] + 3 && v >= box[1] - 3 && v <= box[3] + 3)
    .sort((a, b) => area(a.box) - area(b.box))[0];
  return (
    hit?.id ??
    ownerOf(
      frame,
      pointAt(frame, u, v, PICK_PX / laid.scale, (i) => frame.owner[i] > 0),
    )
  );
}

/** A drag measures between the LiDAR points nearest to its start and end. */
function followTape() {
  /** @type {import("./measuring_tape.js").Spot|null} */
  let from = null;
  canvas.addEventListener("pointerdown", (event) => {
    if (get("align")?.on || !(get("taping") || (event.shiftKey && !get("labeling")?.on))) return;
    from = spotAt(event);
    if (from) canvas.setPointerCapture(event.pointerId);
    else set("tape", null);
  });
  canvas.addEventListener("pointermove", (event) => {
    const to = from && spotAt(event);
    if (from && to) measure(from, to);
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => (from = null));
}

/** @param {PointerEvent} event @returns {import("./measuring_tape.js").Spot|null} */
function spotAt({ offsetX, offsetY }) {
  const frame = get("frame");
  if (!frame) return null;
  const i = pointAt(frame, (offsetX - laid.x) / laid.scale, (offsetY - laid.y) / laid.scale, HOLD_PX / laid.scale);
  if (i < 0) return null;
  const { xyz, uv } = frame;
  return { x: xyz[3 * i] / 100, y: xyz[3 * i + 1] / 100, z: xyz[3 * i + 2] / 100, u: uv[2 * i], v: uv[2 * i + 1] };
}
