/** Labels in the camera image: cuboid edges, boxes and names. */
import { tagsIn } from "../../views/camera.js";
import { drawBox, drawCuboid } from "../../views/drawing/image.js";
import { get } from "../../core/store.js";
import { presentOf, present } from "../state/draft.js";
import { shown } from "../state/labels.js";
import { lookOf } from "./style.js";
import { isOn } from "../state/mode.js";
import { NEW } from "./projection.js";

/** @typedef {import("../state/types.js").Box} Box */
/** @typedef {import("../state/types.js").LabelSighting} LabelSighting */
/** @typedef {import("../../views/camera.js").Place} Place */

const NEW_TINT = "#fff";
/** Dashes of a box that follows its cuboid. */
const FOLLOWING = [2, 3];

/** @param {CanvasRenderingContext2D} ctx @param {import("../../core/types.js").Frame} frame @param {Place} place */
export function drawInImage(ctx, frame, place) {
  const image = frame.image,
    projected = get("projected");
  if (!isOn() || !image) return;
  const scale = place.scale * image.scale;
  const X = (/** @type {number} */ u) => place.x + u * scale,
    Y = (/** @type {number} */ v) => place.y + v * scale;
  const isProjected = projected?.frame === frame.state.index,
    pixels = isProjected ? projected.pixels : new Map();
  const tags = tagsIn(ctx, frame);
  for (const { track } of present()) {
    const box = lookOf(track, true) && boxOf(track);
    if (box) tags.keepFree(X(box[0]), Y(box[1]), (box[2] - box[0]) * scale, (box[3] - box[1]) * scale);
  }
  for (const each of present()) {
    const look = lookOf(each.track, true),
      corners = pixels.get(each.track);
    if (!look) continue;
    const bbox = boxIn(each, corners, image, isProjected);
    ctx.setLineDash(look.dash);
    if (corners) drawCuboid(ctx, corners, look.tint, look.width, X, Y);
    ctx.setLineDash(isFollowing(each) ? FOLLOWING : look.dash);
    if (bbox && (look.isChosen || !corners)) drawBox(ctx, bbox, look.isChosen ? NEW_TINT : look.tint, 1.5, X, Y);
    ctx.setLineDash([]);
    const at = corners ? boundsOf(corners) : bbox;
    if (at && tags.shows(X(at[0]), Y(at[1]), X(at[2]), Y(at[3])))
      tags.put(
        look.name,
        X(at[0]),
        Y(at[1]),
        look.isChosen ? NEW_TINT : look.tint,
        look.isLead ? "strong" : look.isChosen ? "must" : "weak",
      );
  }
  const fresh = pixels.get(NEW),
    draft = get("draft");
  if (fresh) drawCuboid(ctx, fresh, NEW_TINT, 2.5, X, Y);
  if (draft?.track === null && draft.bbox) drawBox(ctx, draft.bbox, NEW_TINT, 2, X, Y);
}

/**
 * Bounding box of the visible corners of a cuboid, or null.
 * @param {import("../../core/types.js").Pixels} corners
 * @returns {Box|null}
 */
export function boundsOf(corners) {
  const seen = corners.filter((pixel) => pixel !== null);
  if (seen.length < 2) return null;
  const us = seen.map(([u]) => u),
    vs = seen.map(([, v]) => v);
  return [Math.min(...us), Math.min(...vs), Math.max(...us), Math.max(...vs)];
}

/** Whether its box is where its cuboid is in the image. @param {LabelSighting} label */
export const isFollowing = ({ cuboid, box_set }) => cuboid !== null && !box_set;

/** Image box of a label. @param {number} track @returns {Box|null} */
export function boxOf(track) {
  const label = presentOf(track),
    image = get("frame")?.image;
  const projected = get("projected"),
    isProjected = projected?.frame === shown();
  if (!label || !image) return null;
  return boxIn(label, isProjected ? projected?.pixels.get(track) : undefined, image, isProjected);
}

/**
 * @param {LabelSighting} label
 * @param {import("../../core/types.js").Pixels|undefined} corners
 * @param {import("../../core/types.js").SentImage} image
 * @param {boolean} isProjected whether the projection of this frame is known; until then the stored box stands in
 * @returns {Box|null} null outside the image
 */
function boxIn(label, corners, { width, height, scale }, isProjected) {
  if (!isFollowing(label) || !isProjected) return label.bbox;
  const around = corners ? boundsOf(corners) : null;
  if (!around) return null;
  const [x1, y1, x2, y2] = around,
    within = (/** @type {number} */ value, /** @type {number} */ end) => Math.min(Math.max(value, 0), end / scale);
  const box = /** @type {Box} */ ([within(x1, width), within(y1, height), within(x2, width), within(y2, height)]);
  return box[0] < box[2] && box[1] < box[3] ? box : null;
}
