/** Text tags on a canvas that keep out of each other's way. */

const HEIGHT = 16;

export class Labels {
  /** @param {CanvasRenderingContext2D} ctx */
  constructor(ctx) {
    this.ctx = ctx;
    /** @type {{x: number, y: number, w: number, h: number}[]} */
    this.taken = [];
  }

  /**
   * A tag whose lower left corner is at (x, y), moved up until it is free; a weak tag that finds no room is left out.
   * @param {string} words @param {number} x @param {number} y @param {string} tint @param {boolean} strong
   */
  put(words, x, y, tint, strong = false) {
    const { ctx } = this;
    const h = strong ? HEIGHT + 4 : HEIGHT;
    ctx.font = `${strong ? "700 13px" : "600 11px"} system-ui, "DejaVu Sans", sans-serif`;
    const w = ctx.measureText(words).width + 10;
    const right = ctx.canvas.clientWidth - w - 2;
    const at = { x: Math.max(2, Math.min(x, right)), y: Math.max(2, y - h - 1), w, h };
    for (let tries = 0; this.#overlaps(at); tries++) {
      if (tries === 3 && !strong) return;
      if (tries === 12) break;
      at.y -= h + 1;
    }
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

  #overlaps(a) {
    return this.taken.some((b) => a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h);
  }
}
