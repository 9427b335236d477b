/**
 * The label being edited: drawn at once in every view, sent on release, dropped when the server's version arrives.
 */
import { get, on, set } from "../../core/store.js";
import { act } from "../acts/queue.js";
import { knownUpTo, sightingsAt } from "./sightings.js";
import { shown, trackOf } from "./labels.js";

/** @typedef {import("./types.js").Cuboid} Cuboid */
/** @typedef {import("./types.js").Box} Box */
/** @typedef {import("./types.js").LabelSighting} LabelSighting */
/**
 * @typedef {object} Draft
 * @property {number|null} track  null for a new one
 * @property {number} frame
 * @property {number} revision  of the track when editing began
 * @property {Cuboid|null} cuboid
 * @property {Box|null} bbox
 * @property {boolean} box_set
 * @property {number|null} settled  revision of the act that saved it
 */

export function setUp() {
  on(["labelFrames"], () => {
    const draft = get("draft");
    if (draft?.settled != null) settle(draft, draft.settled);
  });
}

/**
 * The draft was saved. It stays visible until the server's version has arrived, possibly before the act's answer.
 * @param {Draft} draft
 * @param {number} act
 */
export function settle(draft, act) {
  const isHeld = knownUpTo(draft.frame) >= act;
  if (!isHeld || get("draft")) set("draft", isHeld ? null : { ...draft, settled: act });
}

/** All labels of the current frame, including the draft. @returns {LabelSighting[]} */
export const present = () => presentIn(shown());

/** @param {number} frame @returns {LabelSighting[]} */
function presentIn(frame) {
  const draft = get("draft"),
    known = sightingsAt(frame);
  if (!draft || draft.frame !== frame || draft.track === null) return known;
  const { cuboid, bbox, box_set } = draft,
    before = known.find(({ track }) => track === draft.track),
    said = { truncation: before?.truncation ?? null, occlusion: before?.occlusion ?? null },
    held = { track: draft.track, cuboid, bbox, box_set, keyframe: true, ...said };
  return [...known.filter(({ track }) => track !== held.track), held];
}

/** @param {number|null} track @returns {LabelSighting|null} */
export const presentOf = (track) => (track === null ? null : (present().find((each) => each.track === track) ?? null));

/**
 * Change a track's label in the draft.
 * @param {number} track
 * @param {{cuboid?: Cuboid|null, bbox?: Box|null, box_set?: boolean}} shape
 * @param {number} [frame]
 */
export function hold(track, shape, frame = shown()) {
  const draft = get("draft"),
    before = presentIn(frame).find((each) => each.track === track);
  const isSame = draft?.track === track && draft.frame === frame;
  const revision = isSame ? draft.revision : (trackOf(track)?.revision ?? 0);
  set("draft", {
    track,
    frame,
    revision,
    cuboid: before?.cuboid ?? null,
    bbox: before?.bbox ?? null,
    box_set: before?.box_set ?? false,
    ...shape,
    settled: null,
  });
}

/** Send the draft. If it is edited again meanwhile, editing continues from the saved revision. */
export async function release() {
  const draft = get("draft");
  if (!draft || draft.track === null || draft.settled !== null) return;
  const { track, frame, revision, cuboid, bbox, box_set } = draft;
  const answer = await act({ kind: "set_sighting", track, revision, frame, cuboid, bbox, box_set, interpolate: true });
  const now = get("draft");
  if (now?.track !== track || now.frame !== frame) return;
  const left = answer?.changed?.tracks.find(({ id }) => id === track)?.revision ?? revision;
  // not the object: an answer to an earlier change replaces it
  const isEdited = now.cuboid !== cuboid || now.bbox !== bbox || now.box_set !== box_set;
  if (isEdited) set("draft", { ...now, revision: Math.max(now.revision, left) });
  else if (answer) settle({ ...now, revision: left }, answer.revision);
  else set("draft", null);
}

/** Discard the draft. */
export function drop() {
  set("draft", null);
}
