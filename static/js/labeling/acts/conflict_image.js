/** What two people said of the same frames, as images: from above among the points, in the image, or as a range. */
import { el } from "../../core/dom.js";
import { ui } from "../../core/colors.js";
import { get } from "../../core/store.js";
import { drawBox, drawCuboid } from "../../views/drawing/image.js";
import { footprint, nose } from "../views/cuboid.js";
import { boundsOf } from "../views/image_drawing.js";
import { shown } from "../state/labels.js";

/** @typedef {(metres: number) => number} ToPixel */
/** @typedef {import("../state/types.js").Cuboid} Cuboid */
/** @typedef {import("../state/types.js").Box} Box */
/** @typedef {import("../../core/types.js").Pixels} Pixels */
/** @typedef {import("../../core/types.js").Point2} Point2 */
/** @typedef {{left?: Point2[]|null, right?: Point2[]|null}} Path */
/** @typedef {{cuboid?: Cuboid|null, bbox?: Box|null, box_set?: boolean, pixels?: Pixels|null}} Shape */

const WIDTH_PX = 230,
  HEIGHT_PX = 150,
  /** Metres around the shapes. */
  ROOM_M = 2,
  /** Room around the shapes in the image, as a share of their size. */
  ROOM_SHARE = 0.4,
  CM = 100;

/** @param {string} name @param {(ctx: CanvasRenderingContext2D) => void} draw */
function drawing(name, draw) {
  const sharp = devicePixelRatio || 1;
  const canvas = el("canvas", { class: "conflict-image", aria: { role: "img", label: name } });
  canvas.width = WIDTH_PX * sharp;
  canvas.height = HEIGHT_PX * sharp;
  const ctx = canvas.getContext("2d");
  if (ctx) {
    ctx.scale(sharp, sharp);
    draw(ctx);
  }
  return canvas;
}

/**
 * One person's cuboid from above, ahead is up; the other's is dashed. Both persons' images show the same place.
 * @param {Cuboid|null|undefined} own
 * @param {Cuboid|null|undefined} other
 */
export function fromAbove(own, other) {
  const corners = [own, other].flatMap((cuboid) => (cuboid ? footprint(cuboid) : []));
  if (!own || !corners.length) return null;
  return above(corners, own, other, (ctx, cuboid, u, v) => {
    ctx.beginPath();
    for (const [x, y] of footprint(cuboid)) ctx.lineTo(u(y), v(x));
    ctx.closePath();
    ctx.moveTo(u(cuboid.center[1]), v(cuboid.center[0]));
    const [x, y] = nose(cuboid);
    ctx.lineTo(u(y), v(x));
    ctx.stroke();
  });
}

/**
 * One person's path from above, ahead is up; the other's is dashed.
 * @param {Path|null} own
 * @param {Path|null} other
 */
export function pathFromAbove(own, other) {
  const lines = (/** @type {Path|null} */ path) => [path?.left, path?.right].flatMap((line) => (line ? [line] : []));
  const points = [own, other].flatMap(lines).flat();
  if (!own || !lines(own).length) return null;
  return above(points, own, other, (ctx, path, u, v) => {
    for (const line of lines(path)) {
      ctx.beginPath();
      for (const [x, y] of line) ctx.lineTo(u(y), v(x));
      ctx.stroke();
    }
  });
}

/**
 * One person's shape among the points; the other's is dashed.
 * @template T
 * @param {Point2[]} bounds points that the image contains, in metres
 * @param {T} own
 * @param {T|null|undefined} other
 * @param {(ctx: CanvasRenderingContext2D, shape: T, u: ToPixel, v: ToPixel) => void} outline
 */
function above(bounds, own, other, outline) {
  const xs = bounds.map(([x]) => x),
    ys = bounds.map(([, y]) => y),
    [low, high] = [Math.min(...xs) - ROOM_M, Math.max(...xs) + ROOM_M],
    [right, left] = [Math.min(...ys) - ROOM_M, Math.max(...ys) + ROOM_M];
  const scale = Math.min(WIDTH_PX / (left - right), HEIGHT_PX / (high - low));
  const u = (/** @type {number} */ y) => WIDTH_PX / 2 - (y - (left + right) / 2) * scale,
    v = (/** @type {number} */ x) => HEIGHT_PX / 2 - (x - (low + high) / 2) * scale;
  return drawing("from above", (ctx) => {
    const frame = get("frame");
    ctx.fillStyle = ui("dim");
    for (let n = 0; frame && n < frame.count; n += 1)
      ctx.fillRect(u(frame.xyz[3 * n + 1] / CM) - 1, v(frame.xyz[3 * n] / CM) - 1, 2, 2);
    ctx.lineWidth = 1;
    ctx.strokeStyle = ui("dim");
    ctx.setLineDash([3, 3]);
    if (other) outline(ctx, other, u, v);
    ctx.setLineDash([]);
    ctx.lineWidth = 2;
    ctx.strokeStyle = ui("accent");
    outline(ctx, own, u, v);
  });
}

/**
 * The image around both shapes, with one person's. Null if there is no image or nothing in it.
 * @param {Shape} own
 * @param {Shape} other
 */
export function inImage(own, other) {
  const frame = get("frame"),
    image = frame?.image,
    bitmap = frame?.bitmap;
  const boxes = [own, other].flatMap(({ bbox, pixels }) => [bbox, pixels ? boundsOf(pixels) : null].filter((b) => !!b));
  if (!image || !bitmap || !boxes.length || (!own.bbox && !own.pixels)) return null;
  const all = /** @type {Box[]} */ (boxes);
  const [x1, y1] = [Math.min(...all.map((b) => b[0])), Math.min(...all.map((b) => b[1]))],
    [x2, y2] = [Math.max(...all.map((b) => b[2])), Math.max(...all.map((b) => b[3]))];
  const scale = Math.min(WIDTH_PX / (x2 - x1), HEIGHT_PX / (y2 - y1)) / (1 + ROOM_SHARE);
  const X = (/** @type {number} */ x) => WIDTH_PX / 2 + (x - (x1 + x2) / 2) * scale,
    Y = (/** @type {number} */ y) => HEIGHT_PX / 2 + (y - (y1 + y2) / 2) * scale;
  return drawing("in the image", (ctx) => {
    const wide = bitmap.width / image.scale,
      tall = bitmap.height / image.scale;
    ctx.drawImage(bitmap, X(0), Y(0), wide * scale, tall * scale);
    if (own.pixels) drawCuboid(ctx, own.pixels, ui("accent"), 1.5, X, Y);
    if (own.bbox) drawBox(ctx, own.bbox, "#fff", 1.5, X, Y);
  });
}

/**
 * A range of frames among the recording's, with the current frame.
 * @param {number} first
 * @param {number} last
 */
export function range(first, last) {
  const share = (/** @type {number} */ frames) => `${(100 * frames) / Math.max(1, get("state")?.count ?? 1)}%`;
  const bar = el("i"),
    here = el("b");
  Object.assign(bar.style, { left: share(first), width: share(last + 1 - first) });
  here.style.left = share(shown());
  const label = `frames ${first + 1} to ${last + 1}`;
  return el("div", { class: "conflict-range", aria: { role: "img", label } }, bar, here);
}
