/** What keys and buttons of the labeling mode do: each is one act about the selected track or the shown frame. */
import { request } from "../../core/api.js";
import { seekTo } from "../../drive/seek.js";
import { get, set } from "../../core/store.js";
import { act } from "./queue.js";
import { CLASSES, moved, turned } from "../views/cuboid.js";
import * as draft from "../state/draft.js";
import { chosen, leadAt, shown, trackOf } from "../state/labels.js";
import { setTool } from "../state/mode.js";
import * as span from "../state/marked_frames.js";

/** @typedef {import("../state/types.js").LabelTrack} LabelTrack */
/** @typedef {import("../state/types.js").ItemRef} ItemRef */
/** @typedef {"unlabelled"|"disagreement"|"proposed"|"sent_back"|"unreviewed"} Wanted */

/** A sentence for the person, where something could not be done. @param {string} words */
export const say = (words) => set("said", words);

/** Do something with the selected track, or say that none is selected. @param {(track: LabelTrack) => unknown} what */
function withTrack(what) {
  const track = chosen();
  if (track) what(track);
  else say("Select a label first");
}

/** @param {LabelTrack} track @returns {ItemRef} */
export const refOf = ({ id, revision }) => ({ kind: "track", id, revision });

/** The pipeline's output becomes proposals, in the marked frames or in all. */
export function propose() {
  const isMarked = get("marked") !== null,
    whole = { first: 0, last: Math.max(0, (get("state")?.count ?? 1) - 1) };
  return span.over((frames) => act({ kind: "propose", ...(isMarked ? frames : whole), from: "run" }));
}

/** Accept or reject the selected track whole; without one, who leads here. @param {"accept"|"reject"} kind */
export function judge(kind) {
  const track = chosen();
  if (track) act({ kind, items: [refOf(track)] });
  else if (!span.judge(kind)) say("No label selected, and no lead in this frame");
}

/** Everything of the shown frame that nobody has looked at: its tracks and its lead. */
export function acceptHere() {
  const lead = leadAt(shown());
  const tracks = draft
    .present()
    .map(({ track }) => get("labels")?.tracks.get(track))
    .filter((track) => track?.state === "proposed");
  const items = tracks.map((track) => refOf(/** @type {LabelTrack} */ (track)));
  if (lead?.state === "proposed") items.push({ kind: "lead", id: lead.id, revision: lead.revision });
  if (items.length) act({ kind: "accept", items });
  else say("No proposals in this frame");
}

/** The next or the previous label of the shown frame. @param {1|-1} direction */
export function selectNext(direction) {
  const ids = draft
    .present()
    .map(({ track }) => track)
    .filter((id) => get("labels")?.tracks.get(id)?.state !== "rejected")
    .sort((a, b) => a - b);
  const at = ids.indexOf(get("track") ?? -1);
  const next = at < 0 ? (direction > 0 ? 0 : ids.length - 1) : (at + direction + ids.length) % ids.length;
  set("track", ids[next] ?? null);
}

/** @param {number} dx @param {number} dy metres, ego frame */
export const nudge = (dx, dy) => change((cuboid) => moved(cuboid, dx, dy));
/** @param {number} deg to the left */
export const turn = (deg) => change((cuboid) => turned(cuboid, (deg * Math.PI) / 180));

/** @param {(cuboid: import("../state/types.js").Cuboid) => import("../state/types.js").Cuboid} how */
function change(how) {
  const track = chosen(),
    cuboid = draft.presentOf(track?.id ?? null)?.cuboid;
  if (!track) return say("Select a label first");
  if (!cuboid) return say(`#${track.id} has no cuboid in this frame; draw one (Shift G)`);
  draft.hold(track.id, { cuboid: how(cuboid) });
  draft.release();
}

export const snap = () => withTrack(({ id, revision }) => act({ kind: "refit", track: id, revision, frame: shown() }));
export const splitHere = () =>
  withTrack(({ id, revision }) => act({ kind: "split", track: id, revision, frame: shown() }));
export const dropKeyframe = () =>
  withTrack(({ id, revision }) => act({ kind: "drop_keyframe", track: id, revision, frame: shown() }));
export const removeTrack = () =>
  withTrack((track) => act({ kind: "remove", items: [refOf(track)] }).then((answer) => answer && set("track", null)));

/** Hold the label where it is in this frame; where it is not yet, it begins with the shape of its nearest frame. */
export const keyframe = () =>
  withTrack(async ({ id }) => {
    const frame = shown(),
      shape = draft.presentOf(id) ?? (await nearestShape(id, frame));
    if (!shape || shown() !== frame) return say(`#${id} has no shape yet; draw one`);
    draft.hold(id, { cuboid: shape.cuboid, bbox: shape.bbox });
    draft.release();
  });

/**
 * @param {number} id
 * @param {number} frame
 * @returns {Promise<Pick<import("../state/types.js").LabelSighting, "cuboid"|"bbox">|null>}
 */
async function nearestShape(id, frame) {
  /** @type {{sightings: (import("../state/types.js").LabelSighting & {frame: number})[]}} */
  const { sightings } = await request(`api/labels/tracks/${id}`).catch(() => ({ sightings: [] }));
  return sightings.sort((a, b) => Math.abs(a.frame - frame) - Math.abs(b.frame - frame))[0] ?? null;
}

export const sizeAlong = () =>
  withTrack(({ id, revision }) => {
    const size = draft.presentOf(id)?.cuboid?.size;
    if (size) act({ kind: "size_along", track: id, revision, size });
    else say(`#${id} has no cuboid in this frame; draw one (Shift G)`);
  });

/** The vehicle is not there, in the marked frames or in this one. */
export const notHere = () =>
  withTrack(({ id, revision }) =>
    span.over((frames) => act({ kind: "drop_sightings", track: id, revision, ...frames })),
  );

/** @param {1|-1} direction */
export const nextClass = (direction) =>
  withTrack(({ label }) => {
    relabel(CLASSES[(CLASSES.indexOf(label) + direction + CLASSES.length) % CLASSES.length]);
  });

/** @param {string} label */
export const relabel = (label) => withTrack(({ id, revision }) => act({ kind: "relabel", track: id, revision, label }));

/** Begin to merge the selected track: with the label that is pressed next, or with the one that is selected then. */
export const merge = () =>
  withTrack(({ id }) => {
    setTool("merge");
    if (get("labeling")?.tool === "merge")
      say(`Click the label to merge with #${id}, or select it with . and press Enter`);
  });

/** The track that the merging began with is this one too. @param {number} other */
export function mergeWith(other) {
  const a = trackOf(get("labeling")?.from ?? null),
    b = trackOf(other);
  if (!a || !b || a === b) return say("Select the other label: click it, or press .");
  setTool(null);
  set("track", a.id);
  act({ kind: "merge", tracks: [a, b].map(({ id, revision }) => ({ id, revision })) });
}

/** An event of this frame, about the selected track or else who leads here. @param {string} event */
export function addEvent(event) {
  const track = chosen()?.id ?? leadAt(shown())?.lead;
  return act({ kind: "add_event", frame: shown(), event, tracks: typeof track === "number" ? [track] : [] });
}

/**
 * Go where there is something to do; where that is one label, it is selected, and the next are first the others of its
 * frame.
 * @param {Wanted} what
 * @param {1|-1} direction
 */
export async function goTo(what, direction) {
  const isOfLabels = what === "proposed" || what === "sent_back",
    track = get("track");
  const found = await ahead(
    what,
    get("scrub") ?? shown(),
    direction,
    isOfLabels && track !== null ? `&after_kind=track&after_id=${track}` : "",
  );
  if (found instanceof Error) return say(found.message);
  if (found.frame === null) return say(`No ${what.replace("_", " ")} ${direction > 0 ? "after" : "before"} this frame`);
  if (found.item) set("track", found.item.kind === "track" ? found.item.id : null);
  seekTo(found.frame);
  say(found.why);
}

/**
 * Where there is something to do beyond a frame.
 * @param {Wanted} what
 * @param {number} frame
 * @param {1|-1} direction
 * @param {string} [more] of the query
 * @returns {Promise<import("../state/types.js").Found|Error>}
 */
export const ahead = (what, frame, direction, more = "") =>
  request(`api/labels/next?what=${what}&frame=${frame}&direction=${direction}${more}`).catch((error) => error);
