/** Editing a cuboid seen from above: grips and their effects. In metres. */
import { usualSize } from "../state/classes.js";

/** @typedef {import("../state/types.js").Cuboid} Cuboid */
/** @typedef {import("../../views/drawing/viewport.js").Place} Place */
/** @typedef {import("../../core/types.js").Point2} Point2 */
/**
 * What is dragged: the whole cuboid, the rotation knob, or an edge.
 * @typedef {"move"|"turn"|"front"|"rear"|"left"|"right"} Grip
 */

/** Half lengths and half widths to the corners: front left, front right, rear right, rear left. */
const CORNERS = [
  [0.5, 0.5],
  [0.5, -0.5],
  [-0.5, -0.5],
  [-0.5, 0.5],
];
const SMALLEST_M = 0.2;
/** Of a class without a usual size. @type {[number, number, number]} */
const A_CAR_M = [4.5, 1.8, 1.5];
/** A shorter drag sets only the position, not length and heading. */
const SAYS_FROM_M = 1;

/**
 * Ego coordinates of a point given in the cuboid's frame.
 * @param {Cuboid} cuboid
 * @param {number} along
 * @param {number} across
 * @returns {Point2}
 */
function placeOf({ center: [x, y], yaw_rad }, along, across) {
  const c = Math.cos(yaw_rad),
    s = Math.sin(yaw_rad);
  return [x + along * c - across * s, y + along * s + across * c];
}

/** Coordinates of a place in the cuboid's frame. @param {Cuboid} cuboid @param {Place} place */
function own({ center, yaw_rad }, { x, y }) {
  const c = Math.cos(yaw_rad),
    s = Math.sin(yaw_rad),
    dx = x - center[0],
    dy = y - center[1];
  return { along: dx * c + dy * s, across: dy * c - dx * s };
}

/** @param {Cuboid} cuboid @returns {Point2[]} front left, front right, rear right, rear left */
export const footprint = (cuboid) => CORNERS.map(([l, w]) => placeOf(cuboid, l * cuboid.size[0], w * cuboid.size[1]));

/**
 * Position of the rotation knob, `beyond` metres ahead of the front.
 * @param {Cuboid} cuboid
 * @param {number} beyond metres
 */
export const knob = (cuboid, beyond) => placeOf(cuboid, cuboid.size[0] / 2 + beyond, 0);

/** Centre of the front edge. @param {Cuboid} cuboid */
export const nose = (cuboid) => knob(cuboid, 0);

/** @param {Cuboid} cuboid @param {Place} place */
export function contains(cuboid, place) {
  const { along, across } = own(cuboid, place);
  return Math.abs(along) <= cuboid.size[0] / 2 && Math.abs(across) <= cuboid.size[1] / 2;
}

/**
 * Which edge along one axis is grabbed: positive side (1), negative side (−1), none (0), or outside (null). The middle
 * of a thin cuboid stays grabbable.
 * @param {number} at from the middle
 * @param {number} size
 * @param {number} reach
 */
function edgeAt(at, size, reach) {
  const away = Math.abs(at);
  if (away <= Math.max(size / 2 - reach, reach / 2)) return 0;
  return away <= size / 2 + reach ? Math.sign(at) : null;
}

/**
 * The grip at a place, or null.
 * @param {Cuboid} cuboid @param {Place} place @param {number} reach tolerance around an edge or the knob, metres
 * @param {number} beyond distance of the knob from the front, metres @returns {Grip|null}
 */
export function gripAt(cuboid, place, reach, beyond) {
  const { along, across } = own(cuboid, place),
    [length, width] = cuboid.size;
  if (Math.hypot(along - length / 2 - beyond, across) <= reach * 1.3) return "turn";
  const end = edgeAt(along, length, reach),
    side = edgeAt(across, width, reach);
  if (end === null || side === null) return null;
  if (end) return end > 0 ? "front" : "rear";
  if (side) return side > 0 ? "left" : "right";
  return "move";
}

/** @param {Cuboid} cuboid @param {number} dx @param {number} dy @param {number} [dz] @returns {Cuboid} */
export const moved = (cuboid, dx, dy, dz = 0) => ({
  ...cuboid,
  center: [cuboid.center[0] + dx, cuboid.center[1] + dy, cuboid.center[2] + dz],
});

/**
 * Longer, wider or higher. The side that the sensors see, and the bottom, stay.
 * @param {Cuboid} cuboid
 * @param {number} axis length, width, height
 * @param {number} by metres
 * @returns {Cuboid}
 */
export function grown(cuboid, axis, by) {
  const size = /** @type {[number, number, number]} */ ([...cuboid.size]);
  size[axis] = Math.max(SMALLEST_M, size[axis] + by);
  const half = (size[axis] - cuboid.size[axis]) / 2;
  if (axis === 2) return moved({ ...cuboid, size }, 0, 0, half);
  const ego = own(cuboid, { x: 0, y: 0 }),
    away = (axis === 0 ? ego.along : ego.across) > 0 ? -half : half;
  const [x, y] = placeOf(cuboid, axis === 0 ? away : 0, axis === 0 ? 0 : away);
  return { ...cuboid, size, center: [x, y, cuboid.center[2]] };
}

/** @param {Cuboid} cuboid @param {number} by_rad @returns {Cuboid} */
export const turned = (cuboid, by_rad) => ({
  ...cuboid,
  yaw_rad: Math.atan2(Math.sin(cuboid.yaw_rad + by_rad), Math.cos(cuboid.yaw_rad + by_rad)),
});

/**
 * Move the grabbed edge to a place; the opposite face stays fixed.
 * @param {Cuboid} cuboid
 * @param {Grip} grip
 * @param {Place} place
 * @returns {Cuboid}
 */
function resized(cuboid, grip, place) {
  const axis = grip === "front" || grip === "rear" ? 0 : 1,
    sign = grip === "front" || grip === "left" ? 1 : -1;
  const at = own(cuboid, place),
    reached = sign * (axis === 0 ? at.along : at.across);
  const size = /** @type {[number, number, number]} */ ([...cuboid.size]);
  size[axis] = Math.max(SMALLEST_M, reached + cuboid.size[axis] / 2);
  const shift = (sign * (size[axis] - cuboid.size[axis])) / 2;
  const [x, y] = placeOf(cuboid, axis === 0 ? shift : 0, axis === 0 ? 0 : shift);
  return { ...cuboid, size, center: [x, y, cuboid.center[2]] };
}

/**
 * The cuboid after a drag.
 * @param {Cuboid} cuboid at the start of the drag
 * @param {Grip} grip
 * @param {Place} from
 * @param {Place} to
 * @returns {Cuboid}
 */
export function dragged(cuboid, grip, from, to) {
  if (grip === "move") return moved(cuboid, to.x - from.x, to.y - from.y);
  if (grip === "turn")
    return turned(cuboid, Math.atan2(to.y - cuboid.center[1], to.x - cuboid.center[0]) - cuboid.yaw_rad);
  return resized(cuboid, grip, to);
}

/**
 * A new cuboid, drawn from rear centre to front centre; a short drag uses the default size of its class.
 * @param {Place} from
 * @param {Place} to
 * @param {string} label
 * @param {number} ground_m ground height there
 * @returns {Cuboid}
 */
export function drawn(from, to, label, ground_m) {
  const [length, width, height] = usualSize(label) ?? A_CAR_M,
    far = Math.hypot(to.x - from.x, to.y - from.y);
  const says = far >= SAYS_FROM_M,
    yaw_rad = says ? Math.atan2(to.y - from.y, to.x - from.x) : 0;
  const size = /** @type {[number, number, number]} */ ([says ? far : length, width, height]),
    z = ground_m + height / 2;
  if (says) return { center: [(from.x + to.x) / 2, (from.y + to.y) / 2, z], size, yaw_rad };
  return { center: [from.x + length / 2, from.y, z], size, yaw_rad };
}

/** Ground plane if none was fitted. @type {[number, number, number, number]} */
const FLAT = [0, 0, 1, 0];
/** Maximum distance of a ray's ground intersection. */
const FARTHEST_M = 300;

/**
 * @param {import("../../core/types.js").GroundPlanes|null} ground
 * @param {number} x
 * @returns {number} index of the ground plane there
 */
function planeAt(ground, x) {
  const after = ground?.edges.findIndex((edge) => edge > x) ?? -1,
    count = ground?.planes.length ?? 0;
  return after < 0 ? count - 1 : Math.min(count, Math.max(1, after)) - 1;
}

/**
 * The nearest ground intersection of a ray, or null.
 * @param {import("../../core/types.js").GroundPlanes|null} ground
 * @param {number[]} start
 * @param {number[]} toward
 * @param {number} above height above ground, metres
 * @returns {Point2|null}
 */
export function seenOn(ground, [x, y, z], [dx, dy, dz], above) {
  const planes = ground?.planes.length ? ground.planes : [FLAT],
    isKnown = planes[0] !== FLAT;
  const met = planes.flatMap(([a, b, c, d], i) => {
    const t = -(a * x + b * y + c * (z - above) + d) / (a * dx + b * dy + c * dz),
      at = x + t * dx;
    return t > 0 && (!isKnown || planeAt(ground, at) === i) && Math.hypot(at, y + t * dy) < FARTHEST_M ? [t] : [];
  });
  const t = Math.min(...met);
  return met.length ? [x + t * dx, y + t * dy] : null;
}

/**
 * Ground height at a place; 0 if unknown.
 * @param {import("../../core/types.js").GroundPlanes|null} ground
 * @param {Place} place
 */
export function groundAt(ground, { x, y }) {
  if (!ground?.planes.length) return 0;
  const [a, b, c, d] = ground.planes[planeAt(ground, x)];
  return c === 0 ? 0 : -(a * x + b * y + d) / c;
}
