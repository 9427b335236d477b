/** What lies under a pixel of a view: the nearest point, the nearest object. */

/** @typedef {import("../../core/types.js").Frame} Frame */

/**
 * The point whose place in a view is nearest to a pixel; −1 when none is near enough.
 * @param {number} count @param {(i: number) => boolean} counts which points to look at
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

/** Whose a point is. @param {Frame} frame @param {number} i @returns {number|null} */
export const ownerOf = ({ owner, result }, i) =>
  i < 0 || owner[i] === 0 ? null : (result.objects[owner[i] - 1]?.id ?? null);
