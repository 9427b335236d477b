/**
 * Dragging a cuboid over the road in the camera image, by its base centre. The server provides the viewing rays.
 */
import { newestOnly, request } from "../../core/api.js";
import { get } from "../../core/store.js";
import { groundAt, seenOn } from "./cuboid.js";
import { hold, presentOf, release } from "../state/draft.js";
import { shown } from "../state/labels.js";
import { boundsOf } from "./image_drawing.js";

/** @typedef {import("./image_pointer.js").Pixel} Pixel */
/** @typedef {import("../state/types.js").Cuboid} Cuboid */

/**
 * A drag of a track's cuboid, or null if the pixel is not on it.
 * @param {number} track
 * @param {Pixel} from
 */
export function takes(track, from) {
  const projected = get("projected"),
    corners = projected?.frame === shown() ? projected.pixels.get(track) : undefined;
  const cuboid = presentOf(track)?.cuboid,
    bounds = corners ? boundsOf(corners) : null,
    foot = corners ? middleOf(corners) : null;
  if (
    !cuboid ||
    !bounds ||
    !foot ||
    from.u < bounds[0] ||
    from.u > bounds[2] ||
    from.v < bounds[1] ||
    from.v > bounds[3]
  )
    return null;
  const frame = shown(),
    ground = get("frame")?.display.ground ?? null;
  const above = cuboid.center[2] - groundAt(ground, { x: cuboid.center[0], y: cuboid.center[1] });
  const move = newestOnly(async (/** @type {Pixel} */ to) => {
    const pixel = [foot.u + to.u - from.u, foot.v + to.v - from.v];
    /** @type {{start: number[]|null, toward: number[]|null}} */
    const { start, toward } = await request("api/project/ray", "POST", { pixel }).catch(() => ({
      start: null,
      toward: null,
    }));
    const place = start && toward && seenOn(ground, start, toward, above - cuboid.size[2] / 2);
    if (place)
      hold(
        track,
        { cuboid: { ...cuboid, center: [...place, groundAt(ground, { x: place[0], y: place[1] }) + above] } },
        frame,
      );
  });
  let last = Promise.resolve();
  return {
    moved: (/** @type {Pixel} */ to) => {
      last = move(to);
    },
    ended: () => last.then(release),
  };
}

/**
 * Base centre: the intersection of the diagonals, which is perspective-correct.
 * @param {import("../../core/types.js").Pixels} corners
 * @returns {Pixel|null}
 */
function middleOf([a, b, c, d]) {
  if (!a || !b || !c || !d) return null;
  const [px, py] = [c[0] - a[0], c[1] - a[1]],
    [qx, qy] = [d[0] - b[0], d[1] - b[1]],
    cross = px * qy - py * qx;
  if (Math.abs(cross) < 1e-9) return { u: (a[0] + b[0] + c[0] + d[0]) / 4, v: (a[1] + b[1] + c[1] + d[1]) / 4 };
  const t = ((b[0] - a[0]) * qy - (b[1] - a[1]) * qx) / cross;
  return { u: a[0] + t * px, v: a[1] + t * py };
}
