/**
 * Drawing the ego path manually: a drag along its centre line, with the width of the pipeline's corridor.
 */
import { color } from "../../core/colors.js";
import { trace } from "../../views/drawing/plan.js";
import { get, set } from "../../core/store.js";
import { act } from "../acts/queue.js";
import { shown } from "../state/labels.js";
import { setTool } from "../state/mode.js";

/** @typedef {import("../../core/types.js").Point2} Point2 */
/** @typedef {import("../../views/drawing/viewport.js").Place} Place */
/** @typedef {import("../../views/drawing/viewport.js").Viewport} Viewport */
/** @typedef {{left: Point2[], right: Point2[]}} Lines */

/** Spacing of the points of a drawn path. */
const STEP_M = 1;

/** The drag that draws a path. @param {Place} from @returns {import("../../views/drawing/viewport.js").Drag} */
export function drawing(from) {
  /** @type {Point2[]} */
  const middle = [[from.x, from.y]];
  return {
    moved: ({ x, y }) => {
      const [lastX, lastY] = middle[middle.length - 1],
        far = Math.hypot(x - lastX, y - lastY),
        steps = Math.floor(far / STEP_M);
      for (let i = 1; i <= steps; i++)
        middle.push([lastX + ((x - lastX) * i * STEP_M) / far, lastY + ((y - lastY) * i * STEP_M) / far]);
      set("drawnPath", sides(middle));
    },
    ended: async () => {
      const lines = get("drawnPath");
      if (lines && middle.length > 1) await keep(lines);
      else setTool(null);
    },
    cancelled: () => set("drawnPath", null),
  };
}

/**
 * Save a drawn path for this frame. It is shown as drawn until the labels have it; one drawn meanwhile stays.
 * @param {Lines} lines
 */
export async function keep(lines) {
  setTool(null);
  set("drawnPath", lines);
  await act({ kind: "set_path", frame: shown(), ...lines });
  if (get("drawnPath") === lines) set("drawnPath", null);
}

/** The labelled path of the current frame. */
export const labelled = () =>
  get("labels")?.paths.find(({ frame, state }) => frame === shown() && state !== "rejected") ?? null;

/**
 * Left and right boundaries, half a corridor width from a centre line.
 * @param {Point2[]} middle
 * @returns {Lines}
 */
export function sides(middle) {
  const half = Number(get("params")?.values["path.half_width_m"] ?? 1.5);
  const shifted = (/** @type {number} */ by) =>
    middle.map(([x, y], i) => {
      const [x1, y1] = middle[Math.max(0, i - 1)],
        [x2, y2] = middle[Math.min(middle.length - 1, i + 1)],
        length = Math.hypot(x2 - x1, y2 - y1) || 1;
      return /** @type {Point2} */ ([x - (by * (y2 - y1)) / length, y + (by * (x2 - x1)) / length]);
    });
  return { left: shifted(half), right: shifted(-half) };
}

/**
 * Draw the labelled path of the current frame, or the one being drawn.
 * @param {CanvasRenderingContext2D} ctx
 * @param {Viewport} view
 */
export function drawPathLabel(ctx, view) {
  const drawn = get("drawnPath") ?? labelled();
  if (!drawn) return;
  ctx.strokeStyle = color("path");
  ctx.lineWidth = 2.5;
  for (const line of [drawn.left, drawn.right]) {
    if (!line) continue;
    trace(ctx, view, line);
    ctx.stroke();
  }
}
