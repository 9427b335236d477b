/** Image edges as an overlay: LiDAR depth edges should coincide with them. */
import { context } from "../core/dom.js";

/** @typedef {import("../core/types.js").Frame} Frame */

const WIDTH_PX = 800;
/** Share of the strongest pixels that are candidates; only the ridge of a wide edge is drawn. */
const SHARE = 0.12;
const TINT = [255, 240, 120];

const canvas = document.createElement("canvas");
const ctx = context(canvas, { willReadFrequently: true });
let known = "";

/**
 * @param {CanvasRenderingContext2D} target
 * @param {Frame} frame
 * @param {{x: number, y: number, scale: number}} place
 */
export function drawEdges(target, frame, place) {
  const { bitmap, image, state } = frame;
  if (!bitmap || !image) return;
  const key = `${state.uri} ${state.index}`;
  if (key !== known) {
    known = key;
    find(bitmap);
  }
  target.drawImage(canvas, place.x, place.y, image.width * place.scale, image.height * place.scale);
}

/** Draw the edges onto the offscreen canvas. @param {ImageBitmap} bitmap */
function find(bitmap) {
  const width = Math.min(WIDTH_PX, bitmap.width),
    height = Math.max(1, Math.round((bitmap.height * width) / bitmap.width));
  canvas.width = width;
  canvas.height = height;
  ctx.drawImage(bitmap, 0, 0, width, height);
  const image = ctx.getImageData(0, 0, width, height);
  const { strength, step } = gradient(brightness(image.data), width, height);
  const limit = quantile(strength, 1 - SHARE);
  for (let i = 0; i < strength.length; i++) {
    const isRidge = strength[i] > limit && strength[i] >= strength[i - step[i]] && strength[i] > strength[i + step[i]];
    image.data.set([...TINT, isRidge ? Math.min(255, 130 + strength[i] / 3) : 0], 4 * i);
  }
  ctx.putImageData(image, 0, 0);
}

/** @param {Uint8ClampedArray} rgba */
function brightness(rgba) {
  const grey = new Float32Array(rgba.length / 4);
  for (let i = 0; i < grey.length; i++)
    grey[i] = 0.299 * rgba[4 * i] + 0.587 * rgba[4 * i + 1] + 0.114 * rgba[4 * i + 2];
  return grey;
}

/**
 * Sobel gradient: L1 magnitude, and the index offset to the next pixel along its main direction.
 * @param {Float32Array} grey @param {number} width @param {number} height
 */
function gradient(grey, width, height) {
  const strength = new Float32Array(grey.length),
    step = new Int32Array(grey.length);
  for (let y = 1; y < height - 1; y++) {
    for (let i = y * width + 1; i < (y + 1) * width - 1; i++) {
      const a = grey[i - width - 1],
        b = grey[i - width],
        c = grey[i - width + 1],
        d = grey[i - 1];
      const e = grey[i + 1],
        f = grey[i + width - 1],
        g = grey[i + width],
        h = grey[i + width + 1];
      const across = Math.abs(c + 2 * e + h - a - 2 * d - f),
        down = Math.abs(f + 2 * g + h - a - 2 * b - c);
      strength[i] = across + down;
      step[i] = across > down ? 1 : width;
    }
  }
  return { strength, step };
}

/** @param {Float32Array} values @param {number} share */
const quantile = (values, share) =>
  Float32Array.from(values).sort()[Math.min(values.length - 1, Math.floor(share * values.length))];
