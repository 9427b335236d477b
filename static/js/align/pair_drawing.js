/** Pairs in the camera image: the LiDAR point now, the pixel where it belongs, and where the fit brings it. */
import { get } from "../core/store.js";
import { frameKey, isPairing, pairs } from "./pairs.js";

/** @typedef {{x: number, y: number, scale: number}} Place */
/** @typedef {CanvasRenderingContext2D} Context */

const NOW = "#ffa53d",
  WANTED = "#ffffff",
  FITTED = "#4be07c",
  WRONG = "#ff5c5c",
  DARK = "rgb(0 0 0 / 75%)";
/** Pairs of other frames are fainter: the image does not show what they were picked on. */
const ELSEWHERE = 0.45;

/**
 * @param {Context} ctx
 * @param {import("../core/types.js").Frame} frame
 * @param {Place} place
 */
export function drawPairs(ctx, { image }, place) {
  if (!isPairing() || !image) return;
  const { list, picked, answer } = pairs(),
    perPixel = place.scale * (image.scale ?? 1);
  const at = (/** @type {[number, number]} */ [u, v]) =>
    /** @type {[number, number]} */ ([place.x + u * perPixel, place.y + v * perPixel]);
  ctx.save();
  list.forEach(({ pixel, frame }, k) => {
    ctx.globalAlpha = frame === frameKey() ? 1 : ELSEWHERE;
    const isWrong = answer?.fit?.outliers.includes(k) ?? false;
    const now = answer?.present[k],
      fitted = answer?.fit?.fitted[k],
      wanted = at(pixel);
    if (now) stroke(ctx, lineTo(at(now), wanted), isWrong ? WRONG : NOW, 1.5);
    if (now) stroke(ctx, ring(at(now), 6), isWrong ? WRONG : NOW, 2);
    if (fitted) stroke(ctx, lineTo(at(fitted), wanted), FITTED, 1.5);
    if (fitted) stroke(ctx, ring(at(fitted), 3), FITTED, 2);
    stroke(ctx, cross(wanted, 7), isWrong ? WRONG : WANTED, 1.5);
    number(ctx, wanted, String(k + 1));
  });
  ctx.globalAlpha = 1;
  const hovered = picked ?? get("pairHover");
  if (hovered) {
    for (const dot of hovered.dots.slice(0, 400)) {
      ctx.fillStyle = NOW;
      const [x, y] = at(dot);
      ctx.fillRect(x - 2, y - 2, 4, 4);
    }
    if (hovered.dots.length === 1) stroke(ctx, ring(at(hovered.dots[0]), picked ? 9 : 7), NOW, picked ? 3 : 1.5);
  }
  ctx.restore();
}

/** @param {[number, number]} from @param {[number, number]} to */
function lineTo(from, to) {
  const path = new Path2D();
  path.moveTo(...from);
  path.lineTo(...to);
  return path;
}

/** @param {[number, number]} at @param {number} radius */
function ring([x, y], radius) {
  const path = new Path2D();
  path.arc(x, y, radius, 0, 2 * Math.PI);
  return path;
}

/** Open in the middle, so that the pixel itself is seen. @param {[number, number]} at @param {number} reach */
function cross([x, y], reach) {
  const path = new Path2D();
  for (const [dx, dy] of [
    [1, 0],
    [-1, 0],
    [0, 1],
    [0, -1],
  ]) {
    path.moveTo(x + 2 * dx, y + 2 * dy);
    path.lineTo(x + reach * dx, y + reach * dy);
  }
  return path;
}

/** With a dark edge, so that it is seen on any image. @param {Context} ctx @param {Path2D} path @param {string} tint
 * @param {number} width */
function stroke(ctx, path, tint, width) {
  for (const [color, line] of /** @type {[string, number][]} */ ([
    [DARK, width + 2.5],
    [tint, width],
  ])) {
    ctx.strokeStyle = color;
    ctx.lineWidth = line;
    ctx.stroke(path);
  }
}

/** @param {Context} ctx @param {[number, number]} at @param {string} words */
function number(ctx, [x, y], words) {
  ctx.font = "600 12px system-ui, sans-serif";
  ctx.lineWidth = 3;
  ctx.strokeStyle = DARK;
  ctx.strokeText(words, x + 8, y - 6);
  ctx.fillStyle = WANTED;
  ctx.fillText(words, x + 8, y - 6);
}
