/** The range of frames that the timeline shows; the whole drive until zoomed. */

const SMALLEST = 8;

export class Span {
  count = 1;
  first = 0;
  /** One past the last shown frame. */
  end = 1;
  /** Position of the plot in CSS pixels. */
  left = 0;
  width = 1;

  /** @param {number} count frames of the recording */
  setCount(count) {
    if (count === this.count) return;
    this.count = Math.max(1, count);
    this.fit();
  }

  get isWhole() {
    return this.first <= 0 && this.end >= this.count;
  }

  get perFrame() {
    return this.width / (this.end - this.first);
  }

  fit() {
    this.first = 0;
    this.end = this.count;
  }

  /** Pixel column where a frame begins. @param {number} index */
  x(index) {
    return this.left + (index - this.first) * this.perFrame;
  }

  /** Pixel column of a frame's middle. @param {number} index */
  middle(index) {
    return this.x(index + 0.5);
  }

  /** Whether a pixel column is in the plot. @param {number} x */
  holds(x) {
    return x >= this.left && x <= this.left + this.width;
  }

  /** The frame under a pixel column. @param {number} x */
  index(x) {
    return Math.min(this.count - 1, Math.max(0, Math.floor(this.first + (x - this.left) / this.perFrame)));
  }

  /** The border between frames nearest a pixel column: the number of the frame after it. @param {number} x */
  border(x) {
    return Math.min(this.count, Math.max(0, Math.round(this.first + (x - this.left) / this.perFrame)));
  }

  /**
   * Zoom, keeping the frame under a pixel column in place.
   * @param {number} factor above 1 shows more
   * @param {number} x
   */
  zoom(factor, x) {
    const size = this.end - this.first;
    const wanted = Math.min(this.count, Math.max(Math.min(SMALLEST, this.count), size * factor));
    const share = Math.min(1, Math.max(0, (x - this.left) / this.width));
    this.#place(this.first + share * (size - wanted), wanted);
  }

  /** @param {number} frames to the right when positive */
  pan(frames) {
    this.#place(this.first + frames, this.end - this.first);
  }

  /** Bring a frame into view. @param {number} index @returns {boolean} whether anything moved */
  reveal(index) {
    if (index >= this.first && index + 1 <= this.end) return false;
    const size = this.end - this.first;
    this.#place(index < this.first ? index - 0.1 * size : index - 0.2 * size, size);
    return true;
  }

  /** @param {number} first @param {number} size */
  #place(first, size) {
    this.first = Math.min(this.count - size, Math.max(0, first));
    this.end = this.first + size;
  }
}
