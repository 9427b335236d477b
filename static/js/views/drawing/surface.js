/**
 * A canvas that fills its box at screen resolution. It is CPU-rendered (`willReadFrequently`), which costs half as much
 * as a texture on machines without a GPU. Its size comes from an observer, which avoids forced layouts.
 */
import { ui } from "../../core/colors.js";
import { context } from "../../core/dom.js";

export class Surface {
  /** CSS pixels; 0 while the pane is hidden. */
  width = 0;
  height = 0;
  ratio = 1;
  #canvas;
  #ctx;
  #ground;

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {() => void} changed called when the size has changed
   * @param {string|null} ground background colour, which makes the canvas opaque; null for a transparent one
   */
  constructor(canvas, changed, ground = null) {
    this.#canvas = canvas;
    this.#ground = ground;
    this.#ctx = context(canvas, { willReadFrequently: true, alpha: ground === null });
    new ResizeObserver(([{ contentRect }]) => {
      this.width = contentRect.width;
      this.height = contentRect.height;
      changed();
    }).observe(canvas);
  }

  get isHidden() {
    return this.width === 0 || this.height === 0;
  }

  /** Clear the canvas; returns its context, in CSS pixels. */
  begin() {
    this.ratio = window.devicePixelRatio || 1;
    const width = Math.round(this.width * this.ratio),
      height = Math.round(this.height * this.ratio);
    if (this.#canvas.width !== width || this.#canvas.height !== height) {
      this.#canvas.width = width;
      this.#canvas.height = height;
    }
    this.#ctx.resetTransform();
    this.#wipe(width, height);
    this.#ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    return this.#ctx;
  }

  /** Clear whole device pixels: partial ones would leave residue. @param {number} width @param {number} height */
  #wipe(width, height) {
    if (this.#ground === null) return this.#ctx.clearRect(0, 0, width, height);
    this.#ctx.fillStyle = ui(this.#ground);
    this.#ctx.fillRect(0, 0, width, height);
  }
}
