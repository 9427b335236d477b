/** Trails: relative positions of each object over the last seconds. */
import { get, on } from "../../core/store.js";

const KEPT_S = 3,
  JUMP_S = 1;

/** @typedef {import("../../core/types.js").Point2} Point2 */
/** @type {Map<number, {t: number, at: Point2}[]>} */
const trails = new Map();
let uri = "",
  shownAt = 0,
  sequence = -1;

export function setUp() {
  on(["frame"], remember);
}

/** Oldest first. @param {number} id @returns {Point2[]} */
export const trailOf = (id) => (trails.get(id) ?? []).map(({ at }) => at);

function remember() {
  const frame = get("frame");
  if (!frame || frame.state.sequence === sequence) return;
  const t = frame.result.t_ns / 1e9;
  if (frame.state.uri !== uri || t < shownAt || t - shownAt > JUMP_S) trails.clear();
  [uri, shownAt, sequence] = [frame.state.uri ?? "", t, frame.state.sequence];
  for (const { id, bev } of frame.result.objects) {
    if (!bev) continue;
    const trail = trails.get(id) ?? [],
      last = trail.at(-1);
    if (last?.t === t) trail.pop();
    trail.push({ t, at: middle(bev) });
    trails.set(id, trail);
  }
  for (const [id, trail] of trails) {
    while (trail.length && t - trail[0].t > KEPT_S) trail.shift();
    if (!trail.length) trails.delete(id);
  }
}

/** @param {Point2[]} corners @returns {Point2} */
export const middle = (corners) => [
  corners.reduce((sum, [x]) => sum + x, 0) / corners.length,
  corners.reduce((sum, [, y]) => sum + y, 0) / corners.length,
];
