/** The selected label in the 3D view: the server draws handles and reports their drags. */
import { tell } from "../../core/connection.js";
import { get, on } from "../../core/store.js";
import { hold, presentOf, release } from "../state/draft.js";
import { shown, trackOf } from "../state/labels.js";
import { isOn } from "../state/mode.js";

/**
 * frame: the one being dragged in, which may not be the current one.
 * @typedef {{track: number, frame: number, cuboid: import("../state/types.js").Cuboid, ended: boolean}} Dragged
 */

export function setUp() {
  on(["track", "draft", "labelFrames", "frame", "labeling", "layout"], offer);
  on(["dragged"], follow);
}

function offer() {
  const track = get("track"),
    isSeen = isOn() && get("layout")?.tab === "3d";
  const cuboid = isSeen ? presentOf(track)?.cuboid : null;
  tell("held", track !== null && cuboid ? { track, frame: shown(), cuboid } : null);
}

function follow() {
  const dragged = get("dragged");
  if (!dragged || !isOn() || !trackOf(dragged.track)) return;
  hold(dragged.track, { cuboid: dragged.cuboid }, dragged.frame);
  if (dragged.ended) release();
}
