/**
 * Draws thousands of dots by writing pixels directly. One fillRect each would take tens of milliseconds without a GPU.
 */
import { context } from "../../core/dom.js";

export class DotRaster {
  #canvas = document.createElement("canvas");
  #ctx = context(this.#canvas, { willReadFrequently: true });
  #image = new ImageData(1, 1);
  #pixels = new Uint32Array(this.#image.data.buffer);
  #ratio = 1;

  /** Clear the raster. @param {number} width @param {number} height CSS pixels */
  begin(width, height) {
    this.#ratio = window.devicePixelRatio || 1;
    const w = Math.max(1, Math.round(width * this.#ratio)),
      h = Math.max(1, Math.round(height * this.#ratio));
    if (this.#image.width !== w || this.#image.height !== h) {
      this.#canvas.width = w;
      this.#canvas.height = h;
      this.#image = new ImageData(w, h);
      this.#pixels = new Uint32Array(this.#image.data.buffer);
    }
    this.#pixels.fill(0);
  }

  /**
   * A square around (x, y), in a colour of `rgba`.
   * @param {number} x
   * @param {number} y
   * @param {number} size CSS pixels
   * @param {number} colour
   */
  dot(x, y, size, colour) {
    const side = Math.max(1, Math.round(size * this.#ratio));
    const { width, height } = this.#image;
    const left = Math.round(x * this.#ratio - side / 2),
      top = Math.round(y * this.#ratio - side / 2);
    if (left < 0 || top < 0 || left + side > width || top + side > height) return;
    for (let row = top * width + left, i = 0; i < side; i++, row += width) {
      for (let j = 0; j < side; j++) this.#pixels[row + j] = colour;
    }
  }

  /** Draw the dots onto a canvas, with the top left corner at (x, y). @param {CanvasRenderingContext2D} ctx */
  drawOn(ctx, x = 0, y = 0) {
    this.#ctx.putImageData(this.#image, 0, 0);
    ctx.drawImage(this.#canvas, x, y, this.#image.width / this.#ratio, this.#image.height / this.#ratio);
  }
}

/**
 * A colour in the format of `DotRaster` (little-endian RGBA).
 * @param {string} css `#rrggbb`
 * @param {number} alpha 0–1
 */
export function rgba(css, alpha = 1) {
  const n = parseInt(css.slice(1), 16);
  return pack(n >> 16, (n >> 8) & 255, n & 255, alpha);
}

/** @param {number} r @param {number} g @param {number} b 0–255 @param {number} alpha 0–1 */
export function pack(r, g, b, alpha = 1) {
  return ((Math.round(alpha * 255) << 24) | (b << 16) | (g << 8) | r) >>> 0;
}
