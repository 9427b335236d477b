/** Zoom and pan of the camera image: by wheel or pinch at the pointer, by a drag, by keys at the selected label. */
import { get } from "../core/store.js";

/** @typedef {{x: number, y: number, scale: number}} Place */

/** Maximum number of canvas pixels per camera pixel. */
const LARGEST = 40;
const WHEEL = 0.0016,
  PINCH = 0.012;
const WHOLE = { factor: 1, u: 0.5, v: 0.5 };

/** factor: 1 shows the whole image; u, v: the point at the pane's centre, as a share of the image. */
let view = { ...WHOLE };
/** @type {() => void} */
let changed = () => {};

export const isZoomed = () => view.factor > 1;

/**
 * Position of an image in a pane.
 * @param {{width: number, height: number}} pane
 * @param {{width: number, height: number}} image
 * @returns {Place}
 */
export function placed(pane, image) {
  const whole = Math.min(pane.width / image.width, pane.height / image.height),
    scale = whole * view.factor;
  const x = start(pane.width, image.width * scale, view.u),
    y = start(pane.height, image.height * scale, view.v);
  return { x, y, scale };
}

/**
 * An image larger than its pane covers it completely.
 * @param {number} pane
 * @param {number} image
 * @param {number} share
 */
const start = (pane, image, share) =>
  image <= pane ? (pane - image) / 2 : Math.min(0, Math.max(pane - image, pane / 2 - share * image));

/**
 * @param {HTMLCanvasElement} canvas
 * @param {() => Place} place
 * @param {() => void} redraw
 */
export function setUp(canvas, place, redraw) {
  changed = redraw;
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (get("align")?.on || !imageSize()) return;
      event.preventDefault();
      zoomAt(canvas, place(), event.offsetX, event.offsetY, Math.exp(-event.deltaY * (event.ctrlKey ? PINCH : WHEEL)));
    },
    { passive: false },
  );
  /** @type {{x: number, y: number}|null} */
  let held = null;
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button === 1 && isZoomed()) held = { x: event.offsetX, y: event.offsetY };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    pan(place(), event.offsetX - held.x, event.offsetY - held.y);
    held = { x: event.offsetX, y: event.offsetY };
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => (held = null));
  pinch(canvas, place);
}

/**
 * Two fingers zoom at their position and move the image.
 * @param {HTMLCanvasElement} canvas
 * @param {() => Place} place
 */
function pinch(canvas, place) {
  /** @type {Map<number, {x: number, y: number}>} */
  const fingers = new Map();
  const grip = () => {
    const [a, b] = [...fingers.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.max(1, Math.hypot(a.x - b.x, a.y - b.y)) };
  };
  const put = (/** @type {PointerEvent} */ { pointerId, offsetX, offsetY }) =>
    fingers.set(pointerId, { x: offsetX, y: offsetY });
  canvas.addEventListener("pointerdown", (event) => event.pointerType === "touch" && put(event));
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = fingers.size === 2 ? grip() : null;
    put(event);
    if (!before || get("align")?.on || !imageSize()) return;
    const now = grip();
    pan(place(), now.x - before.x, now.y - before.y);
    zoomAt(canvas, place(), now.x, now.y, now.apart / before.apart);
  });
  for (const name of /** @type {const} */ (["pointerup", "pointercancel"]))
    canvas.addEventListener(name, ({ pointerId }) => fingers.delete(pointerId));
}

/**
 * Zoom, keeping the point under a canvas pixel in place.
 * @param {HTMLCanvasElement} canvas
 * @param {Place} at
 * @param {number} x
 * @param {number} y
 * @param {number} by
 */
function zoomAt(canvas, at, x, y, by) {
  const size = imageSize();
  if (!size) return;
  const factor = bounded(view.factor * by, at.scale / view.factor),
    scale = (at.scale / view.factor) * factor;
  const u = (x - at.x) / at.scale + (canvas.clientWidth / 2 - x) / scale,
    v = (y - at.y) / at.scale + (canvas.clientHeight / 2 - y) / scale;
  show(factor, u / size.width, v / size.height);
}

/** Move the image with the pointer. @param {Place} at @param {number} dx @param {number} dy pixels of the canvas */
export function pan(at, dx, dy) {
  const size = imageSize();
  if (size) show(view.factor, view.u - dx / at.scale / size.width, view.v - dy / at.scale / size.height);
}

/**
 * Zoom by keys at a point of the image.
 * @param {number} by
 * @param {{u: number, v: number}|null} to pixels of the full camera image; null keeps the middle
 * @param {Place} at
 */
export function zoom(by, to, at) {
  const size = imageSize();
  if (!size) return;
  const u = to ? (to.u * size.scale) / size.width : view.u,
    v = to ? (to.v * size.scale) / size.height : view.v;
  show(bounded(view.factor * by, at.scale / view.factor), u, v);
}

/** @param {number} factor @param {number} whole canvas pixels a sent pixel at factor 1 */
const bounded = (factor, whole) =>
  Math.min(Math.max(1, LARGEST / (whole * (imageSize()?.scale ?? 1))), Math.max(1, factor));

/** @param {number} factor @param {number} u @param {number} v */
function show(factor, u, v) {
  const within = (/** @type {number} */ share) => Math.min(Math.max(share, 0), 1);
  view = factor <= 1 ? { ...WHOLE } : { factor, u: within(u), v: within(v) };
  changed();
}

const imageSize = () => get("frame")?.image ?? null;
