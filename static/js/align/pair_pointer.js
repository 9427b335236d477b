/**
 * Picking pairs in the camera image, with mouse or finger: the first press picks a LiDAR point or cluster, the second
 * one its pixel. A drag moves the zoomed image.
 */
import { get, set } from "../core/store.js";
import { groundAt } from "../labeling/views/cuboid.js";
import { place as imagePlace } from "../views/camera.js";
import { pointAt } from "../views/drawing/hit_test.js";
import { pan } from "../views/image_zoom.js";
import { frameKey, isPairing, pairs, pick, place } from "./pairs.js";

/** @typedef {import("../core/types.js").Frame} Frame */
/** @typedef {import("./pairs.js").Picked} Picked */

/** A press that moves farther is a drag. */
const STILL_PX = 6,
  STILL_FINGER_PX = 12;
const REACH_PX = 14,
  REACH_FINGER_PX = 28;

/** @param {HTMLCanvasElement} canvas */
export function followPresses(canvas) {
  /** @type {{id: number, x: number, y: number, lastX: number, lastY: number, isStill: boolean}|null} */
  let held = null;
  let down = 0;
  canvas.addEventListener("pointerdown", (event) => {
    if (!isPairing() || event.button !== 0) return;
    down += 1;
    if (down > 1) return void (held = null); // two fingers zoom
    canvas.setPointerCapture(event.pointerId);
    const { pointerId: id, offsetX: x, offsetY: y } = event;
    held = { id, x, y, lastX: x, lastY: y, isStill: true };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!isPairing()) return;
    if (!held) return hover(event);
    if (held.id !== event.pointerId) return;
    const { offsetX: x, offsetY: y } = event;
    if (Math.hypot(x - held.x, y - held.y) > (isFinger(event) ? STILL_FINGER_PX : STILL_PX)) held.isStill = false;
    if (held.isStill) return;
    pan(x - held.lastX, y - held.lastY);
    held.lastX = x;
    held.lastY = y;
  });
  canvas.addEventListener("pointerup", (event) => {
    down = Math.max(0, down - 1);
    if (held?.id === event.pointerId && held.isStill && isPairing()) press(event);
    held = null;
  });
  canvas.addEventListener("pointercancel", () => {
    down = 0;
    held = null;
  });
  canvas.addEventListener("pointerleave", () => get("pairHover") && set("pairHover", null));
}

const isFinger = (/** @type {PointerEvent} */ { pointerType }) => pointerType === "touch";

/** @param {PointerEvent} event */
function press(event) {
  const { offsetX: x, offsetY: y } = event;
  set("pairHover", null);
  if (pairs().picked) {
    const pixel = imagePixel(x, y);
    return pixel ? place(pixel) : undefined;
  }
  pick(pickedAt(x, y, isFinger(event) ? REACH_FINGER_PX : REACH_PX));
}

let isDue = false;
/** Show what a press would pick. @param {PointerEvent} event */
function hover(event) {
  if (isFinger(event) || isDue) return;
  const { offsetX: x, offsetY: y } = event;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    const found = isPairing() && !pairs().picked ? pickedAt(x, y, REACH_PX) : null;
    if (found || get("pairHover")) set("pairHover", found);
  });
}

/**
 * @param {number} x @param {number} y pixels of the canvas
 * @param {number} reach
 * @returns {Picked|null}
 */
function pickedAt(x, y, reach) {
  const frame = get("frame"),
    { kind } = pairs();
  if (!frame?.image || (kind === "cluster" && !frame.display.ground?.planes.length)) return null;
  const [u, v] = sentPixel(x, y),
    counts = kind === "cluster" ? (/** @type {number} */ i) => frame.owner[i] > 0 : undefined;
  const nearest = pointAt(frame, u, v, reach / imagePlace().scale, counts);
  if (nearest < 0) return null;
  const chosen = kind === "cluster" ? sameOwner(frame, nearest) : [nearest];
  const scale = frame.image.scale ?? 1;
  return {
    kind,
    point: kind === "cluster" ? foot(frame, chosen) : placeOf(frame, nearest),
    dots: chosen.map((i) => [frame.uv[2 * i] / scale, frame.uv[2 * i + 1] / scale]),
    name: frame.result.frame,
    frame: frameKey(),
  };
}

/** @param {number} x @param {number} y pixels of the canvas @returns {[number, number]} */
function sentPixel(x, y) {
  const at = imagePlace();
  return [(x - at.x) / at.scale, (y - at.y) / at.scale];
}

/**
 * The pixel of the original image under a pixel of the canvas; null outside the image.
 * @param {number} x @param {number} y
 * @returns {[number, number]|null}
 */
function imagePixel(x, y) {
  const image = get("frame")?.image,
    [u, v] = sentPixel(x, y);
  if (!image || u < 0 || v < 0 || u >= image.width || v >= image.height) return null;
  return [u / (image.scale ?? 1), v / (image.scale ?? 1)];
}

/** @param {Frame} frame @param {number} i @returns {[number, number, number]} metres */
const placeOf = ({ xyz }, i) => [xyz[3 * i] / 100, xyz[3 * i + 1] / 100, xyz[3 * i + 2] / 100];

/** @param {Frame} frame @param {number} of */
function sameOwner({ count, owner }, of) {
  const found = [];
  for (let i = 0; i < count; i++) if (owner[i] === owner[of]) found.push(i);
  return found;
}

/**
 * Where the vehicle of a cluster stands on the road: in the middle of its width, at its nearest point. Rings miss its
 * roof and its lower edge, so that the middle of its height is not known.
 * @param {Frame} frame @param {number[]} indices
 * @returns {[number, number, number]} metres
 */
function foot(frame, indices) {
  const places = indices.map((i) => placeOf(frame, i));
  const range = Math.min(...places.map(([x, y]) => Math.hypot(x, y))),
    bearing = halfway(places.map(([x, y]) => Math.atan2(y, x)));
  const x = range * Math.cos(bearing),
    y = range * Math.sin(bearing);
  return [x, y, groundAt(frame.display.ground, { x, y })];
}

/** @param {number[]} values */
const halfway = (values) => (Math.min(...values) + Math.max(...values)) / 2;
