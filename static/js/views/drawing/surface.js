/**
 * A canvas as large as its box, at the screen's resolution. It is drawn by the processor: a picture, some lines and
 * thousands of dots ten times a second are quick there, and where a page is composed without a graphics card they cost
 * half of what they do as textures. Its size comes from an observer: asking for it would have the page laid out anew.
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
   * @param {() => void} changed called when it has another size
   * @param {string|null} ground colour of the page that it is drawn on; nothing shines through then, and what lies
   *   behind needs no painting. Null is a sheet to see through
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

  /** The context, in CSS pixels, with nothing drawn. */
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

  /** Whole device pixels: part of a column would keep some of what was. @param {number} width @param {number} height */
  #wipe(width, height) {
    if (this.#ground === null) return this.#ctx.clearRect(0, 0, width, height);
    this.#ctx.fillStyle = ui(this.#ground);
    this.#ctx.fillRect(0, 0, width, height);
  }
}
