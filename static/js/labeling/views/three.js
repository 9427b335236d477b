/** Labels in the 3D view: the server draws them, with handles on the selected one, and reports their drags. */
import { tell } from "../../core/connection.js";
import { get, on } from "../../core/store.js";
import { hold, present, presentOf, release } from "../state/draft.js";
import { shown, stateWords, trackOf } from "../state/labels.js";
import { isOn } from "../state/mode.js";
import { nearest } from "./projection.js";
import { lookOf } from "./style.js";

/** @typedef {import("../state/types.js").Cuboid} Cuboid */
/**
 * @typedef {object} LabelInView
 * @property {number} track
 * @property {Cuboid} cuboid
 * @property {string} text
 * @property {string} role
 * @property {boolean} facing
 */

/**
 * frame: the one being dragged in, which may not be the current one.
 * @typedef {{track: number, frame: number, cuboid: Cuboid, ended: boolean}} Dragged
 */

export function setUp() {
  on(["track", "draft", "labels", "labelFrames", "threshold", "frame", "labeling", "layout"], offer);
  on(["dragged"], follow);
}

function offer() {
  const track = get("track"),
    isSeen = isOn() && get("layout")?.tab === "3d";
  const cuboid = isSeen ? presentOf(track)?.cuboid : null;
  tell("held", track !== null && cuboid ? { track, frame: shown(), cuboid } : null);
  tell("labels_3d", isSeen ? { labels: drawn(), alone: !get("labeling")?.hasObjects } : null);
}

/** @returns {LabelInView[]} */
const drawn = () =>
  nearest(present().flatMap(({ track, cuboid }) => (cuboid ? [[track, cuboid]] : []))).flatMap(([track, cuboid]) => {
    const look = lookOf(track, false),
      known = trackOf(track);
    const text = look && known ? `${look.name}, ${stateWords(known)}` : "";
    return look ? [{ track, cuboid, text, role: look.role, facing: look.isFacing }] : [];
  });

function follow() {
  const dragged = get("dragged");
  if (!dragged || !isOn() || !trackOf(dragged.track)) return;
  hold(dragged.track, { cuboid: dragged.cuboid }, dragged.frame);
  if (dragged.ended) release();
}
