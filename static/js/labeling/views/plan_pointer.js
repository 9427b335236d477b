/** Pointer input on the plan view in labeling mode: select, move, rotate, resize and draw cuboids. */
import { get, set } from "../../core/store.js";
import { act } from "../acts/queue.js";
import { mergeWith } from "../acts/commands.js";
import { contains, dragged, drawn, gripAt, groundAt } from "./cuboid.js";
import { drop, hold, present, presentOf, release, settle } from "../state/draft.js";
import { chosen, shown, trackOf } from "../state/labels.js";
import { lookOf } from "./style.js";
import { isOn, setTool } from "../state/mode.js";
import { newLabel } from "../state/new_class.js";
import * as path from "./path.js";
import { KNOB_PX } from "./plan_drawing.js";

/** @typedef {import("../../views/drawing/viewport.js").Place} Place */
/** @typedef {import("../../views/drawing/viewport.js").Drag} Drag */

const REACH_PX = 6;

/**
 * What a drag from here does; null to pan the view.
 * @param {Place} from
 * @param {number} scale pixels per metre
 * @returns {Drag|null}
 */
export function takes(from, scale) {
  if (!isOn()) return null;
  const tool = get("labeling")?.tool;
  if (tool === "new" || tool === "shape") return drawing(from, tool === "shape" ? (chosen()?.id ?? null) : null);
  if (tool === "path") return path.drawing(from);
  const track = get("track"),
    cuboid = presentOf(track)?.cuboid;
  const grip = cuboid ? gripAt(cuboid, from, REACH_PX / scale, KNOB_PX / scale) : null;
  if (track === null || !cuboid || !grip) return null;
  return { moved: (to) => hold(track, { cuboid: dragged(cuboid, grip, from, to) }), ended: release, cancelled: drop };
}

/**
 * Cursor for the grip under the pointer.
 * @param {Place} place
 * @param {number} scale
 * @returns {string} a CSS cursor, "" for none
 */
export function cursorAt(place, scale) {
  if (get("labeling")?.tool) return "crosshair";
  const cuboid = presentOf(get("track"))?.cuboid;
  const grip = cuboid ? gripAt(cuboid, place, REACH_PX / scale, KNOB_PX / scale) : null;
  if (grip)
    return { move: "move", turn: "grab", front: "ns-resize", rear: "ns-resize", left: "ew-resize", right: "ew-resize" }[
      grip
    ];
  return labelAt(place) === null ? "" : "pointer";
}

/** @param {Place} from @param {number|null} track track to draw, or null for a new one @returns {Drag} */
function drawing(from, track) {
  const ground_m = groundAt(get("frame")?.display.ground ?? null, from),
    label = trackOf(track)?.label ?? newLabel();
  const shape = (/** @type {Place} */ to) => drawn(from, to, label, ground_m);
  const show = (/** @type {Place} */ to) => {
    if (track !== null) hold(track, { cuboid: shape(to) });
    else {
      const fresh = { track: null, revision: 0, bbox: null, box_set: false, settled: null };
      set("draft", { ...fresh, frame: shown(), cuboid: shape(to) });
    }
  };
  show(from);
  return {
    moved: show,
    cancelled: drop,
    ended: () => {
      setTool(null);
      if (track !== null) release();
      else add(label);
    },
  };
}

/** Add the drawn cuboid as a new track. @param {string} label */
async function add(label) {
  const draft = get("draft");
  if (!draft?.cuboid) return;
  const answer = await act({ kind: "add_track", label, frame: draft.frame, cuboid: draft.cuboid, bbox: null });
  const made = answer?.changed?.tracks[0] ?? null;
  if (get("draft") === draft) {
    if (answer && made) settle({ ...draft, track: made.id, revision: made.revision }, answer.revision);
    else drop();
  }
  if (made) set("track", made.id);
}

/** A click selects the label at a place, or completes a merge. @param {Place} place */
export function clicked(place) {
  const id = labelAt(place);
  if (get("labeling")?.tool === "merge" && id !== null) mergeWith(id);
  else set("track", id);
}

/** The smallest label at a place. @param {Place} place @returns {number|null} */
function labelAt(place) {
  const hits = present().filter(({ cuboid, track }) => cuboid && contains(cuboid, place) && lookOf(track, false));
  const area = (/** @type {import("../state/types.js").LabelSighting} */ { cuboid }) =>
    cuboid ? cuboid.size[0] * cuboid.size[1] : 0;
  return hits.sort((a, b) => area(a) - area(b))[0]?.track ?? null;
}
