/** Text labels on a canvas that avoid overlaps. */

const HEIGHT = 16;
/**
 * "strong" labels are filled and always drawn, "must" labels are always drawn, "weak" ones only if there is room.
 * @typedef {"strong"|"must"|"weak"} Weight
 */

export class Labels {
  /**
   * @param {CanvasRenderingContext2D} ctx
   * @param {number} width of the canvas, CSS pixels
   * @param {number} top
   * @param {number} bottom vertical limits
   */
  constructor(ctx, width, top = 0, bottom = Infinity) {
    this.ctx = ctx;
    this.width = width;
    this.top = top;
    this.bottom = bottom;
    /** @type {{x: number, y: number, w: number, h: number}[]} */
    this.taken = [];
  }

  /**
   * Whether a rectangle is in view.
   * @param {number} left @param {number} top @param {number} right @param {number} bottom
   */
  shows(left, top, right, bottom) {
    return left < this.width && right > 0 && top < this.bottom && bottom > this.top;
  }

  /** Keep a rectangle free of labels. @param {number} x @param {number} y @param {number} w @param {number} h */
  keepFree(x, y, w, h) {
    this.taken.push({ x, y, w, h });
  }

  /**
   * Draw a label with its bottom left corner at (x, y), moved up, or to the other side, to avoid others.
   * @param {string} words @param {number} x @param {number} y @param {string} tint @param {Weight} [weight]
   * @param {number} [end] where it ends on the other side; without it, there is none
   */
  put(words, x, y, tint, weight = "weak", end) {
    const { ctx } = this,
      strong = weight === "strong";
    const h = strong ? HEIGHT + 4 : HEIGHT;
    ctx.font = `${strong ? "700 13px" : "600 11px"} system-ui, "DejaVu Sans", sans-serif`;
    const w = ctx.measureText(words).width + 10;
    const at =
      this.#free(x, y, w, h, 3) ??
      (end === undefined ? null : this.#free(end - w, y, w, h, 3)) ??
      (weight === "weak" ? null : (this.#free(x, y, w, h, 11) ?? this.#inside(x, y, w, h)));
    if (!at) return;
    this.taken.push(at);
    ctx.fillStyle = strong ? tint : "rgb(8 10 13 / .78)";
    ctx.beginPath();
    ctx.roundRect(at.x, at.y, w, h, 4);
    ctx.fill();
    ctx.fillStyle = strong ? "#06130a" : tint;
    ctx.textBaseline = "middle";
    ctx.fillText(words, at.x + 5, at.y + h / 2 + 0.5);
    ctx.textBaseline = "alphabetic";
  }

  /**
   * A rectangle near (x, y), its bottom left corner, that overlaps no other, or null. It is moved up this often.
   * @param {number} x @param {number} y @param {number} w @param {number} h @param {number} moves
   */
  #free(x, y, w, h, moves) {
    const at = this.#inside(x, y, w, h);
    for (let tries = 0; this.#overlaps(at); tries++) {
      if (tries === moves) return null;
      at.y = at.y - h - 1 > this.top ? at.y - h - 1 : at.y + (tries + 2) * (h + 1);
      if (at.y + h > this.bottom) return null;
    }
    return at;
  }

  /** @param {number} x @param {number} y @param {number} w @param {number} h */
  #inside(x, y, w, h) {
    return {
      x: Math.max(2, Math.min(x, this.width - w - 2)),
      y: Math.max(this.top + 2, Math.min(y - h - 1, this.bottom - h - 2)),
      w,
      h,
    };
  }

  /** @param {{x: number, y: number, w: number, h: number}} a */
  #overlaps(a) {
    return this.taken.some((b) => a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h);
  }
}
