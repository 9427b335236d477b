/** The part of the plan that a pane shows: x up, y left, metres. Fitted to the road until a person moves it. */

/** What is fitted: from behind our bumper to the farthest lead that matters, and the neighbouring lanes. */
const FROM_X = -5, TO_X = 74, HALF_WIDTH = 13;
const SCALE_LIMITS = [1.5, 200];
const DRAG_FROM_PX = 4;

export class Viewport {
  /** Pixels per metre, and the place at the pane's middle. */
  scale = 1;
  x = 0;
  y = 0;
  width = 1;
  height = 1;
  #isFitted = true;
  #canvas;
  #changed;

  /** @param {HTMLCanvasElement} canvas @param {() => void} changed @param {(place: {x: number, y: number}) => void} clicked */
  constructor(canvas, changed, clicked) {
    this.#canvas = canvas;
    this.#changed = changed;
    canvas.addEventListener("wheel", (event) => this.#onWheel(event), { passive: false });
    canvas.addEventListener("dblclick", () => this.fit());
    canvas.addEventListener("keydown", (event) => this.#onKey(event));
    this.#followPointer(clicked);
  }

  /** Call before drawing. @param {{width: number, height: number}} size */
  resize({ width, height }) {
    this.width = width;
    this.height = height;
    if (!this.#isFitted) return;
    this.scale = Math.max(0.1, Math.min(height / (TO_X - FROM_X), width / (2 * HALF_WIDTH)));
    this.x = FROM_X + height / (2 * this.scale);
    this.y = 0;
  }

  fit() {
    this.#isFitted = true;
    this.#changed();
  }

  /** Pixel column of a y. */
  u(y) {
    return this.width / 2 - (y - this.y) * this.scale;
  }

  /** Pixel row of an x. */
  v(x) {
    return this.height / 2 - (x - this.x) * this.scale;
  }

  /** The place under a pixel. */
  place(u, v) {
    return { x: this.x - (v - this.height / 2) / this.scale, y: this.y - (u - this.width / 2) / this.scale };
  }

  /** Zoom so that the place under (u, v) stays there. */
  zoom(factor, u = this.width / 2, v = this.height / 2) {
    this.#isFitted = false;
    const before = this.place(u, v);
    this.scale = Math.min(SCALE_LIMITS[1], Math.max(SCALE_LIMITS[0], this.scale * factor));
    const after = this.place(u, v);
    this.x += before.x - after.x;
    this.y += before.y - after.y;
    this.#changed();
  }

  #onWheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX, event.offsetY);
  }

  #onKey(event) {
    const factor = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
    if (factor) this.zoom(factor);
    else if (event.key === "0") this.fit();
  }

  #followPointer(clicked) {
    let start = null;
    this.#canvas.addEventListener("pointerdown", (event) => {
      start = { u: event.offsetX, v: event.offsetY, x: this.x, y: this.y, moved: false };
      this.#canvas.setPointerCapture(event.pointerId);
    });
    this.#canvas.addEventListener("pointermove", (event) => {
      if (!start) return;
      const du = event.offsetX - start.u, dv = event.offsetY - start.v;
      start.moved ||= Math.hypot(du, dv) >= DRAG_FROM_PX;
      if (!start.moved) return;
      this.#isFitted = false;
      this.x = start.x + dv / this.scale;
      this.y = start.y + du / this.scale;
      this.#changed();
    });
    this.#canvas.addEventListener("pointerup", (event) => {
      if (start && !start.moved) clicked(this.place(event.offsetX, event.offsetY));
      start = null;
    });
    this.#canvas.addEventListener("pointercancel", () => (start = null));
  }
}
