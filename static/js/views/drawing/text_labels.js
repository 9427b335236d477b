/** Text labels on a canvas that avoid overlaps. */

const HEIGHT = 16;
/** How often a label is moved up by its height to find room; and, if it must be drawn, then. */
const MOVES = 3,
  MOST_MOVES = 11;
/**
 * "strong" labels are filled and always drawn, "must" labels are always drawn, "weak" ones only if there is room.
 * @typedef {"strong"|"must"|"weak"} Weight
 */

/** @typedef {{x: number, y: number, w: number, h: number}} Rectangle */

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
    /** Labels. @type {Rectangle[]} */
    this.taken = [];
    /** What no label covers, unless it must be drawn and has no other room. @type {Rectangle[]} */
    this.kept = [];
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
    this.kept.push({ x, y, w, h });
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
    const beside = (/** @type {Rectangle[]} */ others) =>
      this.#free(x, y, w, h, MOVES, others) ??
      (end === undefined ? null : this.#free(end - w, y, w, h, MOVES, others));
    const at =
      beside([...this.taken, ...this.kept]) ??
      (weight === "weak"
        ? null
        : (beside(this.taken) ?? this.#free(x, y, w, h, MOST_MOVES, this.taken) ?? this.#inside(x, y, w, h)));
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
   * A rectangle near (x, y), its bottom left corner, that overlaps none of the others, or null.
   * @param {number} x @param {number} y @param {number} w @param {number} h
   * @param {number} moves how often it is moved up @param {Rectangle[]} others
   */
  #free(x, y, w, h, moves, others) {
    const at = this.#inside(x, y, w, h);
    for (let tries = 0; overlapsOne(at, others); tries++) {
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
}

/** @param {Rectangle} a @param {Rectangle[]} others */
const overlapsOne = (a, others) =>
  others.some((b) => a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h);
