/** The selected label in the 3D view: the server shows handles there, and tells this page how a hand drags them. */
import { tell } from "../connection.js";
import { get, on } from "../store.js";
import { hold, presentOf, release } from "./draft.js";
import { isOn } from "./mode.js";

/** @typedef {{track: number, cuboid: import("./types.js").Cuboid, ended: boolean}} Dragged */

export function setUp() {
  on(["track", "draft", "labelFrames", "frame", "labeling", "layout"], offer);
  on(["dragged"], follow);
}

function offer() {
  const track = get("track"), isSeen = isOn() && get("layout")?.tab === "3d";
  const cuboid = isSeen ? presentOf(track)?.cuboid : null;
  tell("held", track !== null && cuboid ? { track, cuboid } : null);
}

function follow() {
  const dragged = get("dragged");
  if (!dragged || !isOn() || dragged.track !== get("track")) return;
  hold(dragged.track, { cuboid: dragged.cuboid });
  if (dragged.ended) release();
}
