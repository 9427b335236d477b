/** Hit tests: the nearest point, and the object it belongs to. */

/** @typedef {import("../../core/types.js").Frame} Frame */

/** Pixel coordinate of points outside the camera's view. */
const UNSEEN = -32768;

/**
 * Index of the point nearest to a pixel; −1 if none is within reach.
 * @param {number} count @param {(i: number) => boolean} counts which points to consider
 * @param {(i: number) => number} across @param {(i: number) => number} down their pixels
 * @param {number} u @param {number} v @param {number} reach pixels
 */
export function nearestPoint(count, counts, across, down, u, v, reach) {
  let best = -1,
    least = reach * reach;
  for (let i = 0; i < count; i++) {
    if (!counts(i)) continue;
    const du = across(i) - u,
      dv = down(i) - v,
      away = du * du + dv * dv;
    if (away < least) [best, least] = [i, away];
  }
  return best;
}

/**
 * Index of the LiDAR point nearest to a pixel of the sent image; −1 if none is within reach.
 * @param {Frame} frame
 * @param {number} u
 * @param {number} v
 * @param {number} reach pixels of the sent image
 * @param {(i: number) => boolean} [counts]
 */
export function pointAt({ count, uv }, u, v, reach, counts = () => true) {
  return nearestPoint(
    count,
    (i) => uv[2 * i] !== UNSEEN && counts(i),
    (i) => uv[2 * i],
    (i) => uv[2 * i + 1],
    u,
    v,
    reach,
  );
}

/** Id of the object that a point belongs to, or null. @param {Frame} frame @param {number} i @returns {number|null} */
export const ownerOf = ({ owner, result }, i) =>
  i < 0 || owner[i] === 0 ? null : (result.objects[owner[i] - 1]?.id ?? null);
