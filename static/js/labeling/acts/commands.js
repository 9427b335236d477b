/** Commands of the labeling mode. Each is one act on the selected track or the current frame. */
import { request } from "../../core/api.js";
import { seekTo } from "../../drive/seek.js";
import { get, set } from "../../core/store.js";
import { act } from "./queue.js";
import { grown, moved, turned } from "../views/cuboid.js";
import { classNames, usualSize } from "../state/classes.js";
import * as draft from "../state/draft.js";
import { following, which } from "../state/listed.js";
import { chosen, isAccepted, leadAt, shown, trackOf } from "../state/labels.js";
import { setItem, setTool } from "../state/mode.js";
import { isSure, parted } from "../state/threshold.js";
import * as span from "../state/marked_frames.js";
import { noneLeft } from "./wanted.js";

/** @typedef {import("../state/types.js").LabelTrack} LabelTrack */
/** @typedef {import("../state/types.js").ItemRef} ItemRef */
/** @typedef {import("./wanted.js").Wanted} Wanted */

/** Show a status message. @param {string} words */
export const say = (words) => set("said", words);

/** Run a command on the selected track; without one, say so. @param {(track: LabelTrack) => unknown} what */
function withTrack(what) {
  const track = chosen();
  if (track) what(track);
  else say("Select a label first");
}

/** @param {LabelTrack} track @returns {ItemRef} */
const refOf = ({ id, revision }) => ({ kind: "track", id, revision });

/** Propose labels from the pipeline, in the marked frames or in all frames. */
export async function propose() {
  const isMarked = get("marked") !== null,
    whole = { first: 0, last: Math.max(0, (get("state")?.count ?? 1) - 1) };
  say(""); // the outcome is reported beside what is said from now on
  const answer = await span.over((frames) => act({ kind: "propose", ...(isMarked ? frames : whole), from: "run" }));
  if (!answer) offerComputed();
  return answer;
}

/** Offer to propose what is computed so far, until everything is. */
function offerComputed() {
  const all = get("state")?.count ?? 0;
  if (!computed() || computed() >= all) return;
  set("offer", {
    words: "Propose the computed frames", // those computed when it is pressed
    take: () => act({ kind: "propose", first: 0, last: computed() - 1, from: "run" }),
    isOpen: () => computed() < all,
    about: get("said") ?? "",
    after: "All frames are computed: labels can be proposed",
  });
}

/** Frames of the recording that the present run has come to. */
const computed = () => get("drive")?.now?.done ?? 0;

/**
 * Accept or reject the selected track; without one, or if it is accepted already, the lead range at this frame. In the
 * list of what is to do, the next one is selected at once.
 * @param {"accept"|"reject"} kind
 */
export async function judge(kind) {
  const track = chosen();
  const isLeadsTurn = kind === "accept" && isAccepted(track) && leadAt(shown())?.state === "proposed";
  if (!track || isLeadsTurn) return span.judge(kind) || say("No label selected, and no lead in this frame");
  const next = which() === "open" ? following(track) : null;
  const sent = act({ kind, items: [refOf(track)] });
  if (!next) return;
  select(next);
  if (!(await sent) && get("track") === next.id) select(track);
}

/** Select a track, and seek to it if it is not in this frame. @param {LabelTrack} track */
export function select({ id, first, last }) {
  set("track", id);
  const here = get("scrub") ?? shown();
  if (first !== null && last !== null && (here < first || here > last)) seekTo(here < first ? first : last);
}

/** Accept all proposals in the current frame: tracks and lead. */
export function acceptHere() {
  const lead = leadAt(shown());
  const tracks = draft
    .present()
    .map(({ track }) => get("labels")?.tracks.get(track))
    .filter((track) => track?.state === "proposed" && isSure(track));
  const items = tracks.map((track) => refOf(/** @type {LabelTrack} */ (track)));
  if (lead?.state === "proposed") items.push({ kind: "lead", id: lead.id, revision: lead.revision });
  if (items.length) act({ kind: "accept", items });
  else say("No proposals in this frame");
}

/** Reject all proposals that the threshold hides. */
export function rejectHidden() {
  const items = parted().hidden.map(refOf);
  if (items.length) act({ kind: "reject", items });
}

/** Select the next or previous label of the current frame. @param {1|-1} direction */
export function selectNext(direction) {
  const ids = draft
    .present()
    .map(({ track }) => trackOf(track))
    .filter((track) => track && track.state !== "rejected" && isSure(track))
    .map((track) => /** @type {LabelTrack} */ (track).id)
    .sort((a, b) => a - b);
  const at = ids.indexOf(get("track") ?? -1);
  const next = at < 0 ? (direction > 0 ? 0 : ids.length - 1) : (at + direction + ids.length) % ids.length;
  set("track", ids[next] ?? null);
}

/** @param {number} dx @param {number} dy @param {number} [dz] metres, ego frame */
export const nudge = (dx, dy, dz = 0) => change((cuboid) => moved(cuboid, dx, dy, dz));
/** @param {number} deg to the left */
export const turn = (deg) => change((cuboid) => turned(cuboid, (deg * Math.PI) / 180));
/** @param {0|1|2} axis length, width, height @param {number} by metres */
export const grow = (axis, by) => change((cuboid) => grown(cuboid, axis, by));

/** @param {(cuboid: import("../state/types.js").Cuboid) => import("../state/types.js").Cuboid} how */
function change(how) {
  const track = chosen(),
    cuboid = draft.presentOf(track?.id ?? null)?.cuboid;
  if (!track) return say("Select a label first");
  if (!cuboid) return say(`#${track.id} has no cuboid in this frame; draw one (Shift G)`);
  draft.hold(track.id, { cuboid: how(cuboid) });
  releaseSoon();
}

/** A key in the 3D view is not heard going up. */
const IDLE_MS = 400;
let idle = 0;

/** Send what a key changed once it is let go: while it is held down, that is one act. */
function releaseSoon() {
  if (!idle) addEventListener("keyup", release, { once: true });
  clearTimeout(idle);
  idle = setTimeout(release, IDLE_MS);
}

function release() {
  clearTimeout(idle);
  idle = 0;
  removeEventListener("keyup", release);
  draft.release();
}

/** The image box follows the cuboid again. */
export const boxFollows = () =>
  withTrack(({ id }) => {
    const shape = draft.presentOf(id);
    if (!shape?.cuboid) return say(`#${id} has no cuboid in this frame; draw one (Shift G)`);
    draft.hold(id, { bbox: null, box_set: false });
    draft.release();
  });

export const snap = () => withTrack(({ id, revision }) => act({ kind: "refit", track: id, revision, frame: shown() }));
/** Carry the track on beyond its ends, as far as its points are found. @param {"both"|"forward"|"backward"} way */
export const propagate = (way) =>
  withTrack(({ id, revision }) => act({ kind: "propagate", track: id, revision, way }));
/** Turn the track's cuboids round, in every frame: front and rear were mistaken. */
export const flip = () => withTrack(({ id, revision }) => act({ kind: "flip", track: id, revision }));
export const splitHere = () =>
  withTrack(({ id, revision }) => act({ kind: "split", track: id, revision, frame: shown() }));
export const dropKeyframe = () =>
  withTrack(({ id, revision }) => act({ kind: "drop_keyframe", track: id, revision, frame: shown() }));
export const removeTrack = () =>
  withTrack((track) => act({ kind: "remove", items: [refOf(track)] }).then((answer) => answer && set("track", null)));

/** Set a keyframe. If the label is not in this frame, it takes the shape of the nearest frame that has one. */
export const keyframe = () =>
  withTrack(async ({ id }) => {
    const frame = shown(),
      shape = draft.presentOf(id) ?? (await nearestShape(id, frame));
    if (!shape || shown() !== frame) return say(`#${id} has no shape yet; draw one`);
    draft.hold(id, { cuboid: shape.cuboid, bbox: shape.bbox, box_set: shape.box_set });
    draft.release();
  });

/**
 * @param {number} id
 * @param {number} frame
 * @returns {Promise<Pick<import("../state/types.js").LabelSighting, "cuboid"|"bbox"|"box_set">|null>}
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

/** Remove the track from the marked frames, or from this frame. */
export const notHere = () =>
  withTrack(({ id, revision }) =>
    span.over((frames) => act({ kind: "drop_sightings", track: id, revision, ...frames })),
  );

/**
 * Classes chosen and not yet confirmed by the server, by track: a quick second press continues from the first.
 * @type {Map<number, string>}
 */
const askedClass = new Map();

/** @param {1|-1} direction */
export const nextClass = (direction) =>
  withTrack(({ id, label }) => {
    const all = classNames(),
      now = all.indexOf(askedClass.get(id) ?? label);
    if (all.length) relabel(all[(now + direction + all.length) % all.length]);
  });

/** Change the class, and offer the new one's usual size. @param {string} label */
export const relabel = (label) =>
  withTrack(async ({ id, revision }) => {
    const cuboid = draft.presentOf(id)?.cuboid,
      size = usualSize(label);
    askedClass.set(id, label);
    const answer = await act({ kind: "relabel", track: id, revision, label });
    if (askedClass.get(id) === label) askedClass.delete(id);
    if (!answer || !cuboid || !size || cuboid.size.every((side, axis) => side === size[axis])) return;
    set("offer", {
      words: `Size of a ${label}: ${size.join(" × ")} m`,
      take: () => act({ kind: "size_along", track: id, revision: trackOf(id)?.revision ?? revision, size }),
      isOpen: () => get("track") === id && trackOf(id)?.label === label,
    });
  });

/** Start merging the selected track with the label that is clicked or selected next. */
export const merge = () =>
  withTrack(({ id }) => {
    setTool("merge");
    if (get("labeling")?.tool === "merge")
      say(`Click the label to merge with #${id}, or select it with . and press Enter`);
  });

/** Finish the merge with this track. @param {number} other */
export function mergeWith(other) {
  const a = trackOf(get("labeling")?.from ?? null),
    b = trackOf(other);
  if (!a || !b || a === b) return say("Select the other label: click it, or press .");
  setTool(null);
  set("track", a.id);
  act({ kind: "merge", tracks: [a, b].map(({ id, revision }) => ({ id, revision })) });
}

/** Add an event to this frame, for the selected track or else the lead. @param {string} event */
export function addEvent(event) {
  const track = chosen()?.id ?? leadAt(shown())?.lead;
  return act({ kind: "add_event", frame: shown(), event, tracks: typeof track === "number" ? [track] : [] });
}

/**
 * Go to the next open item. If it is a single label, select it; other labels of the same frame come next.
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
  if (found.frame === null) return say(noneLeft(what, direction));
  if (found.item || what === "unlabelled") set("track", found.item?.kind === "track" ? found.item.id : null);
  seekTo(found.frame);
  say(found.why);
}

/** Go to the first of the whole drive, whoever made it. @param {"proposed"|"unreviewed"} what */
export async function goToFirst(what) {
  const found = await ahead(what, -1, 1);
  if (found instanceof Error) return say(found.message);
  if (found.frame === null || !found.item) return say(`Nothing ${what} any more`);
  set("track", found.item.kind === "track" ? found.item.id : null);
  setItem(found.item);
  seekTo(found.frame);
  say(found.why);
}

/**
 * Find the next open item after or before a frame.
 * @param {Wanted} what
 * @param {number} frame
 * @param {1|-1} direction
 * @param {string} [more] of the query
 * @returns {Promise<import("../state/types.js").Found|Error>}
 */
export const ahead = (what, frame, direction, more = "") =>
  request(`api/labels/next?what=${what}&frame=${frame}&direction=${direction}${more}`).catch((error) => error);
