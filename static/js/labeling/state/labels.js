/** The labels known to this page, as one immutable value in the store. */
import { get } from "../../core/store.js";

/** @typedef {import("./types.js").LabelTrack} LabelTrack */
/** @typedef {import("./types.js").LeadRange} LeadRange */
/** @typedef {import("./types.js").LabelSighting} LabelSighting */
/** @typedef {import("./types.js").LabelsAnswer} LabelsAnswer */
/** @typedef {import("./types.js").ItemKind} ItemKind */
/**
 * @typedef {object} Labels
 * @property {number} revision
 * @property {string} uri
 * @property {string} drive  of its content
 * @property {number} load  incremented on a full reload, which invalidates everything before
 * @property {Map<number, LabelTrack>} tracks
 * @property {LeadRange[]} leads  by first frame
 * @property {import("./types.js").PathLabel[]} paths
 * @property {import("./types.js").EventLabel[]} events
 * @property {import("./types.js").FrameTag[]} tags
 */

let loads = 0;

/** @param {string} uri @param {string} drive @returns {Labels} */
export const nothing = (uri, drive) => ({
  revision: 0,
  uri,
  drive,
  load: ++loads,
  tracks: new Map(),
  leads: [],
  paths: [],
  events: [],
  tags: [],
});

/** Merge changes into the known labels. @param {Labels} before @param {LabelsAnswer} answer @returns {Labels} */
export function merged(before, answer) {
  const gone = (/** @type {ItemKind} */ kind) =>
    new Set(answer.removed.filter((each) => each.kind === kind).map(({ id }) => id));
  const tracks = new Map(before.tracks);
  for (const id of gone("track")) tracks.delete(id);
  for (const track of answer.tracks) tracks.set(track.id, track);
  return {
    ...before,
    revision: answer.revision,
    tracks,
    leads: joined(before.leads, answer.leads, gone("lead")).sort((a, b) => a.first - b.first),
    paths: joined(before.paths, answer.paths, gone("path")),
    events: joined(before.events, answer.events, gone("event")),
    tags: joined(before.tags, answer.tags, gone("tag")),
  };
}

/** @template {{id: number}} T @param {T[]} before @param {T[]} changed @param {Set<number>} gone @returns {T[]} */
function joined(before, changed, gone) {
  const fresh = new Set(changed.map(({ id }) => id));
  return [...before.filter(({ id }) => !gone.has(id) && !fresh.has(id)), ...changed];
}

/** @param {number|null} id */
export const trackOf = (id) => (id === null ? null : (get("labels")?.tracks.get(id) ?? null));

export const chosen = () => trackOf(get("track"));

/** Whether a person stands by it. @param {{state: string}|null} label */
export const isAccepted = (label) => label?.state === "accepted" || label?.state === "corrected";

/** The lead range at a frame, or null. Rejected ranges are ignored. @param {number} frame */
export const leadAt = (frame) =>
  get("labels")?.leads.find(({ first, last, state }) => first <= frame && frame <= last && state !== "rejected") ??
  null;

/** The displayed frame, which acts refer to. */
export const shown = () => get("frame")?.state.index ?? 0;

/** @param {LabelTrack} track */
export const isSentBack = ({ state, comment }) => Boolean(comment) && state === "proposed";

/** What people have said of it. @param {LabelTrack} track */
export const stateWords = (track) => (track.reviewer ? "reviewed" : isSentBack(track) ? "sent back" : track.state);

/** @param {LabelTrack|null} track */
export const nameOf = (track) => (track ? `#${track.id} ${track.label}` : "nothing");

/** @param {import("./types.js").Lead} lead */
export const leadName = (lead) => (lead === "none" ? "none" : lead === "unknown" ? "unclear" : `#${lead}`);
