/** Drawing by keyboard: a new cuboid ahead, a box around a label, the ego path. Adjusted with arrow keys. */
import { get, set } from "../../core/store.js";
import { act } from "./queue.js";
import { say } from "./commands.js";
import { drawn, groundAt } from "../views/cuboid.js";
import * as draft from "../state/draft.js";
import { chosen, shown } from "../state/labels.js";
import { setTool } from "../state/mode.js";
import { newLabel } from "../state/new_class.js";
import { keep, labelled, sides } from "../views/path.js";
import { boxOf } from "../views/image_drawing.js";

/** @typedef {import("../../core/types.js").Point2} Point2 */
/** @typedef {import("../state/types.js").Box} Box */

const AHEAD_M = 20,
  PATH_M = 40,
  STEP_M = 1,
  BEND_M = 0.25,
  SHIFT_M = 0.1;
/** Size of a default box, and of a step, as a share of the image width. */
const BOX_SHARE = 0.06,
  STEP_SHARE = 0.002;

/** Centre line of the pipeline's path, or straight ahead without one. @returns {Point2[]} */
function middleOfPath() {
  const center = get("frame")?.result.path?.center ?? [];
  return center.length > 1
    ? center
    : [
        [0, 0],
        [PATH_M, 0],
      ];
}

/** Lateral position of a line at a distance ahead. @param {Point2[]} line @param {number} x */
function lateral(line, x) {
  const after = Math.min(
    Math.max(
      1,
      line.findIndex((point) => point[0] >= x),
    ),
    line.length - 1,
  );
  const [x1, y1] = line[after - 1],
    [x2, y2] = line[after];
  return x2 === x1 ? y1 : y1 + ((y2 - y1) * (x - x1)) / (x2 - x1);
}

/** Add a vehicle of the class chosen in the bar, in the path ahead. */
export async function placeAhead() {
  setTool(null);
  const label = newLabel(),
    at = { x: AHEAD_M, y: lateral(middleOfPath(), AHEAD_M) };
  const cuboid = drawn(at, at, label, groundAt(get("frame")?.display.ground ?? null, at));
  const answer = await act({ kind: "add_track", label, frame: shown(), cuboid, bbox: null });
  const made = answer?.changed?.tracks[0]?.id;
  if (made !== undefined) set("track", made);
}

/** Place a cuboid for the selected label in the path ahead; its distance is adjusted with arrow keys. */
export function cuboidAhead() {
  const track = chosen(),
    at = { x: AHEAD_M, y: lateral(middleOfPath(), AHEAD_M) };
  if (!track) return say("Select a label first");
  setTool(null);
  draft.hold(track.id, { cuboid: drawn(at, at, track.label, groundAt(get("frame")?.display.ground ?? null, at)) });
  draft.release();
}

/** Add an image box around the projected cuboid of the selected label, or in the image centre without one. */
export function boxAround() {
  const track = chosen();
  if (!track) return say("Select a label first");
  const bbox = boxOf(track.id) ?? middleBox();
  if (!bbox) return say("This frame has no image");
  draft.hold(track.id, { bbox, box_set: true });
  draft.release();
  return bbox;
}

/** @returns {number|null} width of the full camera image, pixels */
function imageWidth() {
  const image = get("frame")?.image;
  return image ? image.width / image.scale : null;
}

/** @returns {Box|null} */
function middleBox() {
  const image = get("frame")?.image,
    width = imageWidth();
  if (!image || !width) return null;
  const u = width / 2,
    v = image.height / image.scale / 2,
    half = (width * BOX_SHARE) / 2;
  return [u - half, v - half, u + half, v + half];
}

/**
 * Move the box of the selected label, or with `isSize` its right and bottom edges.
 * @param {number} du
 * @param {number} dv steps
 * @param {boolean} isSize
 */
export function changeBox(du, dv, isSize) {
  const track = chosen(),
    step = (imageWidth() ?? 0) * STEP_SHARE;
  const box = track && (boxOf(track.id) ?? boxAround());
  if (!track || !box) return;
  const [x1, y1, x2, y2] = box,
    [dx, dy] = [du * step, dv * step];
  const [left, top] = isSize ? [x1, y1] : [x1 + dx, y1 + dy];
  draft.hold(track.id, { bbox: [left, top, Math.max(left + 1, x2 + dx), Math.max(top + 1, y2 + dy)], box_set: true });
  draft.release();
}

/** @returns {Point2[]} one point per metre, of the drawn path, else the labelled one, else the pipeline's */
function drawnMiddle() {
  const { left, right } = get("drawnPath") ?? labelled() ?? { left: null, right: null };
  if (left && right && left.length === right.length)
    return left.map(([x, y], i) => [(x + right[i][0]) / 2, (y + right[i][1]) / 2]);
  const line = middleOfPath(),
    last = Math.max(STEP_M, line[line.length - 1][0]);
  return Array.from({ length: Math.floor(last / STEP_M) + 1 }, (_, i) => [i * STEP_M, lateral(line, i * STEP_M)]);
}

/**
 * Bend the far end of the path, or with `isWhole` shift the whole path; positive is left.
 * @param {number} steps
 * @param {boolean} isWhole
 */
export function bendPath(steps, isWhole) {
  const middle = drawnMiddle(),
    length = middle[middle.length - 1][0] || 1;
  set(
    "drawnPath",
    sides(middle.map(([x, y]) => [x, y + (isWhole ? steps * SHIFT_M : steps * BEND_M * (x / length) ** 2)])),
  );
}

/** @param {1|-1} direction lengthen or shorten by 1 m */
export function lengthenPath(direction) {
  const middle = drawnMiddle(),
    [[x1, y1], [x2, y2]] = middle.slice(-2);
  set(
    "drawnPath",
    sides(direction > 0 ? [...middle, [2 * x2 - x1, 2 * y2 - y1]] : middle.slice(0, Math.max(2, middle.length - 1))),
  );
}

/** Save the drawn path, else the labelled or the pipeline's. */
export const keepPath = () => keep(get("drawnPath") ?? sides(drawnMiddle()));
