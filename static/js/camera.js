/** The camera pane: the picture, and over it what the line made of it. Nothing is projected here. */
import { RANGE_COLORS, RANGE_MAX_M, RANGE_STEPS, onPicture, roleOf } from "./colors.js";
import { $, fitted, text } from "./dom.js";
import { num } from "./format.js";
import { Labels } from "./labels.js";
import { DotRaster, pack } from "./raster.js";
import { get, paint, select } from "./store.js";

const UNSEEN = -32768;
const GROUND = 0;
const EDGES = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

const TINTS = RANGE_COLORS.map(([r, g, b]) => pack(r, g, b, 0.95));
const GROUND_TINTS = RANGE_COLORS.map(([r, g, b]) => pack(r, g, b, 0.7));

const canvas = $("#camera");
const raster = new DotRaster();
/** Where the picture lies in the pane. */
let laid = { x: 0, y: 0, scale: 1 };
/** @typedef {{x: number, y: number, scale: number}} Place */
/** @typedef {(ctx: CanvasRenderingContext2D, frame: import("./types.js").Frame, place: Place) => void} Layer */
/** @type {Layer[]} */
const extra = [];

/** Have something drawn over the picture and under points and boxes. @param {Layer} draw */
export function addLayer(draw) {
  extra.push(draw);
}

/** Where the picture lies: canvas pixel = x + u·scale, for a pixel u of the sent picture. @returns {Place} */
export const place = () => laid;

export function setUp() {
  const invalidate = paint(["frame", "layers", "selection", "theme", "align"], draw);
  new ResizeObserver(invalidate).observe(canvas);
  canvas.addEventListener("click", (event) => !get("align")?.on && select(objectAt(event.offsetX, event.offsetY)));
}

function draw() {
  const frame = get("frame");
  const { ctx, width, height } = fitted(canvas);
  if (!frame) return;
  describe(frame);
  if (!frame.picture) return message(ctx, width, height, "No camera picture in this frame");
  const { picture } = frame;
  fitPane(picture);
  const scale = Math.min(width / picture.width, height / picture.height);
  laid = { x: (width - picture.width * scale) / 2, y: (height - picture.height * scale) / 2, scale };
  ctx.save();
  ctx.beginPath();
  ctx.rect(laid.x, laid.y, picture.width * scale, picture.height * scale);
  ctx.clip();
  const align = get("align"), blend = align?.on ? align.blend : null;
  if (blend !== null) ctx.globalAlpha = Math.min(1, 2 * (1 - blend));
  if (frame.bitmap) ctx.drawImage(frame.bitmap, laid.x, laid.y, picture.width * scale, picture.height * scale);
  else message(ctx, width, height, "The picture of this frame could not be decoded");
  const layers = get("layers");
  ctx.globalAlpha = 1;
  for (const layer of extra) layer(ctx, frame, laid);
  if (blend !== null) {
    ctx.globalAlpha = Math.min(1, 2 * blend);
    drawPoints(ctx, frame, width, height);
    ctx.globalAlpha = 1;
  } else {
    if (layers.path && frame.display.path) drawPath(ctx, frame.display.path);
    if (layers.points) drawPoints(ctx, frame, width, height);
    drawObjects(ctx, frame, layers);
  }
  ctx.restore();
}

/** Without a height chosen by a person, the pane is as high as its picture. */
function fitPane({ width, height }) {
  const aspect = (width / height).toFixed(3);
  const workspace = $("#workspace");
  if (workspace.style.getPropertyValue("--aspect") !== aspect) workspace.style.setProperty("--aspect", aspect);
}

function describe(frame) {
  const { sensors } = frame.result;
  const facts = frame.picture ? [`${Math.round(frame.picture.width / frame.picture.scale)}×${Math.round(frame.picture.height / frame.picture.scale)}`] : [];
  if (sensors.lidar?.points) facts.push(`${sensors.lidar.points.toLocaleString("en")} points`);
  if (sensors.camera?.skew_ms) facts.push(`camera ${num(sensors.camera.skew_ms, 0)} ms after LiDAR`);
  text($("#camera-facts"), facts.join(" · "));
}

const X = (u) => laid.x + u * laid.scale;
const Y = (v) => laid.y + v * laid.scale;

function drawPath(ctx, path) {
  const outline = [...path.left, ...[...path.right].reverse()].filter(Boolean);
  if (outline.length < 3) return;
  trace(ctx, outline);
  ctx.closePath();
  const tint = onPicture("path");
  ctx.fillStyle = tint;
  ctx.globalAlpha = 0.16;
  ctx.fill();
  ctx.globalAlpha = 0.9;
  ctx.strokeStyle = tint;
  ctx.lineWidth = 1.5;
  for (const side of [path.left, path.right]) {
    trace(ctx, side.filter(Boolean));
    ctx.stroke();
  }
  ctx.globalAlpha = 1;
}

function trace(ctx, pixels) {
  ctx.beginPath();
  pixels.forEach(([u, v], i) => (i ? ctx.lineTo(X(u), Y(v)) : ctx.moveTo(X(u), Y(v))));
}

/** Points coloured by range, ground fainter and smaller, near ones over far ones. */
function drawPoints(ctx, { count, xyz, uv, kind, picture }, width, height) {
  raster.begin(width, height);
  const perStep = (RANGE_MAX_M * 100) / RANGE_STEPS;
  for (const isGround of [true, false]) {
    const tints = isGround ? GROUND_TINTS : TINTS;
    for (let i = 0; i < count; i++) {
      if ((kind[i] === GROUND) !== isGround) continue;
      const u = uv[2 * i], v = uv[2 * i + 1];
      if (u === UNSEEN || u < 0 || v < 0 || u >= picture.width || v >= picture.height) continue;
      const step = Math.min(RANGE_STEPS - 1, Math.floor(Math.hypot(xyz[3 * i], xyz[3 * i + 1]) / perStep));
      raster.dot(X(u), Y(v), isGround ? 1 : 2, tints[step]);
    }
  }
  raster.drawOn(ctx);
}

function drawObjects(ctx, frame, layers) {
  const { result, display } = frame;
  const lead = result.cipv?.id ?? null;
  const labels = new Labels(ctx);
  const farFirst = [...result.objects].sort((a, b) => (b.distance_m ?? 1e9) - (a.distance_m ?? 1e9));
  for (const item of farFirst) {
    const strong = item.id === lead || item.id === get("selection");
    const tint = onPicture(roleOf(item, lead));
    const vision = display.vision_boxes[item.id], lidar = display.lidar_boxes[item.id];
    ctx.globalAlpha = item.carried ? 0.5 : 1;
    ctx.setLineDash(item.carried ? [4, 3] : []);
    if (layers.cuboids && display.cuboids[item.id]) cuboid(ctx, display.cuboids[item.id], strong ? tint : onPicture("lidar"), strong ? 2.5 : 1.2);
    if (layers.lidarBoxes && lidar) box(ctx, lidar, onPicture("lidar"), 1);
    if (layers.visionBoxes && vision) box(ctx, vision, strong ? tint : onPicture("vision"), strong ? 3 : 1.5);
    if (strong && !vision && lidar) box(ctx, lidar, tint, 2.5);
    ctx.setLineDash([]);
    if (item.id === get("selection") && (vision ?? lidar)) halo(ctx, vision ?? lidar);
    ctx.globalAlpha = 1;
  }
  for (const item of farFirst.reverse()) {
    const anchor = display.vision_boxes[item.id] ?? display.lidar_boxes[item.id];
    const isLead = item.id === lead;
    if (!anchor || !(isLead || item.id === get("selection") || deservesTag(item))) continue;
    if (anchor === display.vision_boxes[item.id] ? !layers.visionBoxes && !isLead : !layers.cuboids && !layers.lidarBoxes && !isLead) continue;
    const name = isLead ? `CIPV #${item.id}` : `#${item.id} ${item.type ?? ""}`.trim();
    const words = item.distance_m === null ? name : `${name}  ${num(item.distance_m)} m`;
    labels.put(words, X(anchor[0]), Y(anchor[1]), onPicture(roleOf(item, lead)), isLead);
  }
}

/** Roadside returns and what is only carried along would bury the picture in tags. */
const deservesTag = (item) => !item.carried && (item.source !== "L" || item.in_path);

function box(ctx, [x1, y1, x2, y2], tint, width) {
  ctx.strokeStyle = tint;
  ctx.lineWidth = width;
  ctx.strokeRect(X(x1), Y(y1), (x2 - x1) * laid.scale, (y2 - y1) * laid.scale);
}

function halo(ctx, [x1, y1, x2, y2]) {
  ctx.strokeStyle = "#fff";
  ctx.lineWidth = 1.5;
  ctx.strokeRect(X(x1) - 4, Y(y1) - 4, (x2 - x1) * laid.scale + 8, (y2 - y1) * laid.scale + 8);
}

function cuboid(ctx, corners, tint, width) {
  ctx.strokeStyle = tint;
  ctx.lineWidth = width;
  ctx.beginPath();
  for (const [a, b] of EDGES) {
    if (!corners[a] || !corners[b]) continue;
    ctx.moveTo(X(corners[a][0]), Y(corners[a][1]));
    ctx.lineTo(X(corners[b][0]), Y(corners[b][1]));
  }
  ctx.stroke();
}

function message(ctx, width, height, words) {
  ctx.fillStyle = "#8a94a3";
  ctx.font = "13px system-ui, sans-serif";
  ctx.textAlign = "center";
  ctx.fillText(words, width / 2, height / 2);
  ctx.textAlign = "start";
}

/** The smallest box under the pointer. */
function objectAt(px, py) {
  const frame = get("frame");
  if (!frame) return null;
  const u = (px - laid.x) / laid.scale, v = (py - laid.y) / laid.scale;
  const hits = frame.result.objects
    .map(({ id }) => ({ id, b: frame.display.vision_boxes[id] ?? frame.display.lidar_boxes[id] }))
    .filter(({ b }) => b && u >= b[0] - 3 && u <= b[2] + 3 && v >= b[1] - 3 && v <= b[3] + 3)
    .sort((p, q) => (p.b[2] - p.b[0]) * (p.b[3] - p.b[1]) - (q.b[2] - q.b[0]) * (q.b[3] - q.b[1]));
  return hits[0]?.id ?? null;
}
