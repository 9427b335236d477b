/**
 * Viewport of the plan view: x up, y left, in metres. A named view follows the pane's size until the user pans or
 * zooms.
 */

/** @typedef {{x: number, y: number}} Place */
/** @typedef {"ahead"|"around"} View */
/** Height of the tools at the bottom edge, which must not cover the ego vehicle. */
const TOOLS_PX = 36;
/**
 * Extent of each view in metres. "ahead" covers the farthest relevant lead and the adjacent lanes.
 */
const VIEWS = { ahead: { from: -5, to: 74, half: 13 }, around: { from: -50, to: 50, half: 50 } };
const SCALE_LIMITS = [1.5, 200];
const DRAG_FROM_PX = 4;

/**
 * @typedef {object} Hand pointer input handlers
 * @property {() => void} changed the viewport has changed
 * @property {(place: Place) => void} clicked
 * @property {() => boolean} hasKeys whether keys zoom; a mode may use them otherwise
 * @property {(from: Place, event: PointerEvent) => Drag|null} takes what a drag from here does; null to pan
 */
/**
 * @typedef {object} Drag
 * @property {(to: Place) => void} moved
 * @property {() => void} [ended]  released after a move
 * @property {() => void} [cancelled]  released without a move, or cancelled
 */

export class Viewport {
  /** Pixels per metre, and the position at the pane's centre. */
  scale = 1;
  x = 0;
  y = 0;
  width = 1;
  height = 1;
  /** Null once the user has panned or zoomed. @type {View|null} */
  view = "ahead";
  #canvas;
  #hand;

  /** @param {HTMLCanvasElement} canvas @param {Hand} hand */
  constructor(canvas, hand) {
    this.#canvas = canvas;
    this.#hand = hand;
    canvas.addEventListener("wheel", (event) => this.#onWheel(event), { passive: false });
    canvas.addEventListener("dblclick", () => this.show("ahead"));
    canvas.addEventListener("keydown", (event) => this.#onKey(event));
    this.#followPointer();
  }

  /** Call before drawing. @param {{width: number, height: number}} size */
  resize({ width, height }) {
    this.width = width;
    this.height = height;
    if (this.view === null) return;
    const { from, to, half } = VIEWS[this.view];
    const free = this.view === "ahead" ? height - TOOLS_PX : height;
    this.scale = Math.max(0.1, Math.min(free / (to - from), width / (2 * half)));
    this.x = this.view === "ahead" ? from + (height / 2 - TOOLS_PX) / this.scale : (from + to) / 2;
    this.y = 0;
  }

  /** @param {View} view */
  show(view) {
    this.view = view;
    this.#hand.changed();
  }

  /** Pixel column of a y. @param {number} y */
  u(y) {
    return this.width / 2 - (y - this.y) * this.scale;
  }

  /** Pixel row of an x. @param {number} x */
  v(x) {
    return this.height / 2 - (x - this.x) * this.scale;
  }

  /** The position under a pixel. @param {number} u @param {number} v @returns {Place} */
  place(u, v) {
    return { x: this.x - (v - this.height / 2) / this.scale, y: this.y - (u - this.width / 2) / this.scale };
  }

  /** Zoom, keeping the position under (u, v) in place. @param {number} factor */
  zoom(factor, u = this.width / 2, v = this.height / 2) {
    this.view = null;
    const before = this.place(u, v);
    this.scale = Math.min(SCALE_LIMITS[1], Math.max(SCALE_LIMITS[0], this.scale * factor));
    const after = this.place(u, v);
    this.x += before.x - after.x;
    this.y += before.y - after.y;
    this.#hand.changed();
  }

  /** @param {WheelEvent} event */
  #onWheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX, event.offsetY);
  }

  /** @param {KeyboardEvent} event */
  #onKey(event) {
    if (!this.#hand.hasKeys()) return;
    /** @type {Record<string, number>} */
    const factors = { "+": 1.25, "=": 1.25, "-": 0.8 };
    if (factors[event.key]) this.zoom(factors[event.key]);
    else if (event.key === "0" || event.code === "Digit0") this.show("ahead");
    else return;
    event.preventDefault();
  }

  #followPointer() {
    /** @type {{u: number, v: number, x: number, y: number, place: Place, drag: Drag|null, moved: boolean}|null} */
    let start = null;
    this.#canvas.addEventListener("pointerdown", (event) => {
      const { offsetX: u, offsetY: v } = event,
        place = this.place(u, v);
      start = { u, v, x: this.x, y: this.y, place, drag: this.#hand.takes(place, event), moved: false };
      this.#canvas.setPointerCapture(event.pointerId);
    });
    this.#canvas.addEventListener("pointermove", (event) => {
      if (!start) return;
      const du = event.offsetX - start.u,
        dv = event.offsetY - start.v;
      start.moved ||= Math.hypot(du, dv) >= DRAG_FROM_PX;
      if (!start.moved) return;
      if (start.drag) return start.drag.moved(this.place(event.offsetX, event.offsetY));
      this.view = null;
      this.x = start.x + dv / this.scale;
      this.y = start.y + du / this.scale;
      this.#hand.changed();
    });
    this.#canvas.addEventListener("pointerup", (event) => {
      const held = start;
      start = null;
      if (!held) return;
      if (held.moved) return held.drag?.ended?.();
      held.drag?.cancelled?.();
      this.#hand.clicked(this.place(event.offsetX, event.offsetY));
    });
    this.#canvas.addEventListener("pointercancel", () => {
      start?.drag?.cancelled?.();
      start = null;
    });
  }
}
