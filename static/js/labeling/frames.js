/** What is labelled in the frames around the shown one. A drive may hold a hundred thousand labels: only these are fetched. */
import { newestOnly, request } from "../api.js";
import { get, on, set } from "../store.js";
import { shown } from "./held.js";

/** @typedef {import("./types.js").LabelSighting} LabelSighting */
/** @typedef {{revision: number, byFrame: Record<string, LabelSighting[]>}} Chunk */

/** Frames in one request, and how many such stretches are kept. */
const CHUNK = 20, KEPT = 12;

/** By their number, the one used last at the end. @type {Map<number, Chunk>} */
const chunks = new Map();

const fetchChunk = newestOnly(async (/** @type {number} */ number) => {
  const labels = get("labels");
  if (!labels || isFresh(number)) return;
  const last = Math.min((get("state")?.count ?? 1) - 1, (number + 1) * CHUNK - 1);
  /** @type {import("./types.js").SightingsAnswer|null} */
  const answer = await request(`api/labels/frames?first=${number * CHUNK}&last=${last}`).catch(() => null);
  if (!answer || get("labels")?.uri !== labels.uri) return;
  keep(number, { revision: answer.revision, byFrame: answer.sightings });
  set("labelFrames", (get("labelFrames") ?? 0) + 1);
});

export function setUp() {
  let uri = "";
  on(["labels", "frame", "labeling"], () => {
    const labels = get("labels");
    if (labels?.uri !== uri) {
      uri = labels?.uri ?? "";
      chunks.clear();
    }
    if (labels && get("labeling")?.on) look(shown());
  });
}

/** @param {number} frame */
function look(frame) {
  const number = Math.floor(frame / CHUNK), isNearEnd = frame % CHUNK >= CHUNK - CHUNK / 4;
  if (!isFresh(number)) fetchChunk(number);
  else if (isNearEnd && (number + 1) * CHUNK < (get("state")?.count ?? 0) && !isFresh(number + 1)) fetchChunk(number + 1);
}

/** @param {number} number */
const isFresh = (number) => (chunks.get(number)?.revision ?? -1) >= (get("labels")?.revision ?? 0);

/** @param {number} number @param {Chunk} chunk */
function keep(number, chunk) {
  chunks.delete(number);
  chunks.set(number, chunk);
  if (chunks.size > KEPT) chunks.delete([...chunks.keys()][0]);
}

/** What is labelled in a frame, as far as it is known here; while a change is being fetched, what was. @param {number} frame @returns {LabelSighting[]} */
export const sightingsAt = (frame) => chunks.get(Math.floor(frame / CHUNK))?.byFrame[frame] ?? [];

/** Up to which act the labels of a frame are known. @param {number} frame */
export const knownUpTo = (frame) => chunks.get(Math.floor(frame / CHUNK))?.revision ?? -1;
