/** Zoom and pan of the camera image: by wheel or pinch at the pointer, by a drag, by keys at the selected label. */
import { get } from "../core/store.js";

/** @typedef {{x: number, y: number, scale: number}} Place */
/** @typedef {{width: number, height: number}} Size */

/** Maximum number of canvas pixels per camera pixel. */
const LARGEST = 40;
const WHEEL = 0.0016,
  PINCH = 0.012;
const WHOLE = { factor: 1, u: 0.5, v: 0.5 };

/** factor: 1 shows the whole image; u, v: the point at the pane's centre, as a share of the image. */
let view = { ...WHOLE };
/** @type {() => void} */
let changed = () => {};
/** Size of the pane. @type {() => {width: number, height: number}} */
let pane = () => ({ width: 0, height: 0 });

/** Whether a drag and the wheel align LiDAR and camera. */
const isTurning = () => get("align")?.on && !get("pairs")?.isOn;

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

/** Where the image is now; several events may come before it is painted there. @param {Size} image */
const now = (image) => placed(pane(), image);

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
 * @param {() => Size} size of the pane
 * @param {() => void} redraw
 */
export function setUp(canvas, size, redraw) {
  changed = redraw;
  pane = size;
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (isTurning() || !imageSize()) return;
      event.preventDefault();
      zoomAt(event.offsetX, event.offsetY, Math.exp(-event.deltaY * (event.ctrlKey ? PINCH : WHEEL)));
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
    pan(event.offsetX - held.x, event.offsetY - held.y);
    held = { x: event.offsetX, y: event.offsetY };
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => (held = null));
  pinch(canvas);
}

/**
 * Two fingers zoom at their position and move the image.
 * @param {HTMLCanvasElement} canvas
 */
function pinch(canvas) {
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
    if (!before || isTurning() || !imageSize()) return;
    const after = grip();
    pan(after.x - before.x, after.y - before.y);
    zoomAt(after.x, after.y, after.apart / before.apart);
  });
  for (const name of /** @type {const} */ (["pointerup", "pointercancel"]))
    canvas.addEventListener(name, ({ pointerId }) => fingers.delete(pointerId));
}

/**
 * Zoom, keeping the point under a canvas pixel in place.
 * @param {number} x
 * @param {number} y
 * @param {number} by
 */
function zoomAt(x, y, by) {
  const size = imageSize();
  if (!size) return;
  const at = now(size),
    whole = at.scale / view.factor,
    factor = bounded(view.factor * by, whole),
    scale = whole * factor;
  const u = (x - at.x) / at.scale + (pane().width / 2 - x) / scale,
    v = (y - at.y) / at.scale + (pane().height / 2 - y) / scale;
  show(factor, u / size.width, v / size.height);
}

/** Move the image with the pointer. @param {number} dx @param {number} dy pixels of the canvas */
export function pan(dx, dy) {
  const size = imageSize();
  if (!size) return;
  const at = now(size),
    u = (pane().width / 2 - at.x - dx) / at.scale,
    v = (pane().height / 2 - at.y - dy) / at.scale;
  show(view.factor, u / size.width, v / size.height);
}

/**
 * Zoom by keys at a point of the image.
 * @param {number} by
 * @param {{u: number, v: number}|null} to pixels of the full camera image; null keeps the middle
 */
export function zoom(by, to) {
  const size = imageSize();
  if (!size) return;
  const u = to ? (to.u * size.scale) / size.width : view.u,
    v = to ? (to.v * size.scale) / size.height : view.v;
  show(bounded(view.factor * by, now(size).scale / view.factor), u, v);
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
