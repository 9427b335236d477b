/** The camera image with the ego path, the lead and whatever else ACC reacts to. */
import { showImageAt } from "../js/core/connection.js";
import { onImage, ui } from "../js/core/colors.js";
import { $, text } from "../js/core/dom.js";
import { num } from "../js/core/format.js";
import { isImaged } from "../js/core/object_sources.js";
import { drawBox, drawPath } from "../js/views/drawing/image.js";
import { get, on, paint } from "../js/core/store.js";
import { Surface } from "../js/views/drawing/surface.js";
import { isAlarmed, reactsTo } from "./acc.js";

/** @typedef {import("../js/core/types.js").Frame} Frame */

const TAG_PX = 20,
  ALARM = "#ff5a5f";
const canvas = $("#road", HTMLCanvasElement),
  notes = $("#notes");
/** @type {Surface} */
let surface;

export function setUp() {
  surface = new Surface(canvas, paint(["frame", "theme"], draw));
  showImageAt(canvas.clientWidth * devicePixelRatio);
  on(["frame", "state"], say);
}

function say() {
  const problems = (get("state")?.notices ?? []).filter(({ level }) => level === "error").map((notice) => notice.text);
  text(notes, [...problems, ...(get("frame")?.result.notes ?? [])].join(" · "));
}

function draw() {
  if (surface.isHidden) return;
  const ctx = surface.begin(),
    frame = get("frame");
  if (!frame) return;
  if (!frame.image || !frame.bitmap) return sayNoImage(ctx);
  const { width, height } = frame.image;
  // fill the pane; only the sides are cropped, where no lead can be
  const scale = Math.max(
    Math.min(surface.width / width, surface.height / height),
    Math.min(surface.height / height, (1.5 * surface.width) / width),
  );
  const left = (surface.width - width * scale) / 2,
    top = (surface.height - height * scale) / 2;
  const X = (/** @type {number} */ u) => left + u * scale,
    Y = (/** @type {number} */ v) => top + v * scale;
  showImageAt(width * scale * surface.ratio);
  ctx.globalAlpha = Number(ui("light"));
  ctx.drawImage(frame.bitmap, left, top, width * scale, height * scale);
  ctx.globalAlpha = 1;
  ctx.save();
  ctx.beginPath();
  ctx.rect(left, top, width * scale, height * scale);
  ctx.clip();
  if (frame.display.path) drawPath(ctx, frame.display.path, X, Y);
  ctx.restore();
  drawObjects(ctx, frame, X, Y);
}

/** @param {CanvasRenderingContext2D} ctx */
function sayNoImage(ctx) {
  ctx.fillStyle = "#9aa4b2";
  ctx.font = "600 20px system-ui, sans-serif";
  ctx.textAlign = "center";
  ctx.fillText("No camera image", surface.width / 2, surface.height / 2);
  ctx.textAlign = "start";
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {Frame} frame
 * @param {(u: number) => number} X
 * @param {(v: number) => number} Y
 */
function drawObjects(ctx, { result, display }, X, Y) {
  const lead = result.cipv?.id ?? null,
    acted = reactsTo(result),
    alarmed = isAlarmed(result);
  /** @param {number} id */
  const boxOf = (id) => display.vision_boxes[id] ?? display.lidar_boxes[id];
  const important = (/** @type {number} */ id) => id === lead || id === acted;
  const farFirst = [...result.objects].sort((a, b) => (b.distance_m ?? 1e9) - (a.distance_m ?? 1e9));
  for (const item of farFirst) {
    const box = boxOf(item.id);
    if (!box || important(item.id) || item.carried || !isImaged(item)) continue;
    ctx.globalAlpha = 0.55;
    drawBox(ctx, box, onImage("fused"), 1.5, X, Y);
    ctx.globalAlpha = 1;
  }
  for (const item of farFirst.filter(({ id }) => important(id))) {
    const box = boxOf(item.id);
    if (!box) continue;
    const tint = item.id === acted && alarmed ? ALARM : item.id === lead ? onImage("cipv") : onImage("warning");
    ctx.setLineDash(item.carried ? [8, 6] : []);
    drawBox(ctx, box, tint, 4, X, Y);
    ctx.setLineDash([]);
    drawTag(ctx, `${item.id === lead ? "" : `#${item.id} `}${num(item.distance_m)} m`, X(box[0]), Y(box[1]), tint);
  }
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {string} words
 * @param {number} x
 * @param {number} y of its lower left corner
 * @param {string} tint
 */
function drawTag(ctx, words, x, y, tint) {
  ctx.font = `700 ${TAG_PX}px system-ui, "DejaVu Sans", sans-serif`;
  const width = ctx.measureText(words).width + 16,
    height = TAG_PX + 10;
  const left = Math.max(2, Math.min(x - 2, surface.width - width - 2)),
    top = Math.max(2, Math.min(y - height, surface.height - height - 2));
  ctx.fillStyle = tint;
  ctx.beginPath();
  ctx.roundRect(left, top, width, height, 6);
  ctx.fill();
  ctx.fillStyle = "#06130a";
  ctx.textBaseline = "middle";
  ctx.fillText(words, left + 8, top + height / 2 + 1);
  ctx.textBaseline = "alphabetic";
}
