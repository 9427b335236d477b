/** Syncs labels with the server: fetches changes when the stream's state announces a new revision. */
import { newestOnly, request } from "../../core/api.js";
import { get, on, set } from "../../core/store.js";
import { merged, nothing } from "./labels.js";

/** @typedef {import("./types.js").LabelsAnswer} LabelsAnswer */

/** URI of the recording that the known labels belong to. @type {string|null} */
let uri = null;

const refresh = newestOnly(
  async (/** @type {boolean} */ isWhole) => {
    const state = get("state"),
      held = get("labels");
    if (!state?.labels || !state.uri) return;
    /** @type {LabelsAnswer|null} */
    const answer = await request(`api/labels?since=${isWhole ? 0 : (held?.revision ?? 0)}`).catch(() => null);
    if (!answer || get("state")?.uri !== state.uri) return;
    const now = get("labels"),
      isOther = held !== null && (answer.drive.id !== held.drive || answer.revision < held.revision);
    if (isOther) set("draft", null);
    if (isWhole || !held) set("labels", merged(nothing(state.uri, answer.drive.id), answer));
    else if (isOther) refresh(true);
    else if (now && answer.revision > now.revision) set("labels", merged(now, answer));
  },
  (waiting, newer) => waiting || newer,
);

export function setUp() {
  on(["state", "labeling"], follow);
  // after a reconnection, the server may have another database
  on(["link"], () => get("link")?.status === "live" && get("labels") && refresh(true));
}

/** Labels are fetched only in the labeling mode. */
function follow() {
  const state = get("state");
  if (!state) return;
  if (uri !== null && state.uri !== uri)
    for (const key of /** @type {const} */ (["labels", "track", "draft", "marked", "trimmed"])) set(key, null);
  uri = state.uri;
  if (!state.labels || !get("labeling")?.on) return;
  if (!get("labels") || state.labels.revision > (get("labels")?.revision ?? 0)) refresh(false);
}

/**
 * Apply what an act changed, and fetch changes by others; resolves once the page has both.
 * @param {LabelsAnswer} changed
 */
export async function accept(changed) {
  const labels = get("labels");
  if (labels && labels.drive === changed.drive.id && changed.revision === labels.revision + 1)
    set("labels", merged(labels, changed));
  else if (labels && changed.revision > labels.revision) await refresh(false);
}

/** Force a refresh. */
export const look = () => refresh(false);
