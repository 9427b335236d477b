/**
 * Label shapes around the current frame. A drive may hold a hundred thousand, so only nearby ones are fetched.
 */
import { newestOnly, request } from "../../core/api.js";
import { get, on, set } from "../../core/store.js";
import { shown } from "./labels.js";

/** @typedef {import("./types.js").LabelSighting} LabelSighting */
/** @typedef {{revision: number, byFrame: Record<string, LabelSighting[]>}} Chunk */

/**
 * Frames per request, fewer in dense drives to keep answers small; number of cached chunks.
 */
const CHUNKS = [20, 10, 5, 2, 1],
  MOST_SIGHTINGS = 1500,
  KEPT = 24;
let size = CHUNKS[0];

/** By chunk number, most recently used last. @type {Map<number, Chunk>} */
const chunks = new Map();

const fetchChunk = newestOnly(async (/** @type {number} */ number) => {
  const labels = get("labels");
  if (!labels || isFresh(number)) return;
  const asked = size,
    last = Math.min((get("state")?.count ?? 1) - 1, (number + 1) * size - 1);
  /** @type {import("./types.js").SightingsAnswer|null} */
  const answer = await request(`api/labels/frames?first=${number * size}&last=${last}`).catch(() => null);
  if (!answer || get("labels")?.load !== labels.load || asked !== size) return;
  keep(number, { revision: answer.revision, byFrame: answer.sightings });
  if (number === Math.floor(shown() / size) || get("draft")) set("labelFrames", (get("labelFrames") ?? 0) + 1);
});

export function setUp() {
  let load = 0;
  on(["labels", "frame", "labeling"], () => {
    const labels = get("labels");
    const fitting = labels ? sizeFor(labels) : size;
    if ((labels?.load ?? 0) !== load || fitting !== size) {
      load = labels?.load ?? 0;
      size = fitting;
      chunks.clear();
    }
    if (labels && get("labeling")?.on) look(shown());
  });
  // request labels of a seek target right after the frame, so that both arrive together
  on(["scrub"], () =>
    queueMicrotask(() => {
      const going = get("scrub");
      if (going !== null && get("labels") && get("labeling")?.on) look(going);
    }),
  );
}

let weighed = { labels: /** @type {import("./labels.js").Labels|null} */ (null), size };

/** Frames per request. @param {import("./labels.js").Labels} labels */
function sizeFor(labels) {
  if (weighed.labels === labels) return weighed.size;
  let sightings = 0;
  for (const track of labels.tracks.values()) sightings += track.sightings;
  const each = sightings / Math.max(1, get("state")?.count ?? 1);
  weighed = { labels, size: CHUNKS.find((frames) => frames * each <= MOST_SIGHTINGS) ?? 1 };
  return weighed.size;
}

/** @param {number} frame */
function look(frame) {
  const number = Math.floor(frame / size),
    isNearEnd = frame % size >= size - Math.max(1, size / 4);
  if (!isFresh(number)) fetchChunk(number);
  else if (
    isNearEnd &&
    get("state")?.playing &&
    (number + 1) * size < (get("state")?.count ?? 0) &&
    !isFresh(number + 1)
  )
    fetchChunk(number + 1);
}

/** @param {number} number */
const isFresh = (number) => (chunks.get(number)?.revision ?? -1) >= (get("labels")?.revision ?? 0);

/** @param {number} number @param {Chunk} chunk */
function keep(number, chunk) {
  chunks.delete(number);
  chunks.set(number, chunk);
  if (chunks.size > KEPT) chunks.delete([...chunks.keys()][0]);
}

/**
 * Known label shapes of a frame; possibly outdated while a change is being fetched.
 * @param {number} frame
 * @returns {LabelSighting[]}
 */
export const sightingsAt = (frame) => chunks.get(Math.floor(frame / size))?.byFrame[frame] ?? [];

/**
 * Whether the labels of a frame have been loaded.
 * @param {number} frame
 */
export const isKnown = (frame) => chunks.has(Math.floor(frame / size));

/** Revision up to which the labels of a frame are known. @param {number} frame */
export const knownUpTo = (frame) => chunks.get(Math.floor(frame / size))?.revision ?? -1;
