/** Keeping up with the server: what changed is fetched when the stream's state says that something has. */
import { newestOnly, request } from "../api.js";
import { get, on, set } from "../store.js";
import { merged, nothing } from "./held.js";

/** @typedef {import("./types.js").LabelsAnswer} LabelsAnswer */

const refresh = newestOnly(async () => {
  const state = get("state");
  if (!state?.labels || !state.uri) return;
  const before = get("labels") ?? nothing(state.uri);
  /** @type {LabelsAnswer|null} */
  const answer = await request(`api/labels?since=${before.revision}`).catch(() => null);
  if (!answer || get("state")?.uri !== state.uri) return;
  const now = get("labels") ?? before;
  if (answer.revision > now.revision || !get("labels")) set("labels", merged(now, answer));
});

export function setUp() {
  on(["state", "labeling"], follow);
}

/** Labels are looked at when a person labels; until then nothing is fetched. */
function follow() {
  const state = get("state"), labels = get("labels");
  if (labels && labels.uri !== state?.uri) for (const key of /** @type {const} */ (["labels", "track", "draft", "marked"])) set(key, null);
  if (!state?.labels || !get("labeling")?.on) return;
  if (!get("labels") || state.labels.revision > (get("labels")?.revision ?? 0)) refresh(undefined);
}

/** What an act changed; when others acted in between, theirs is fetched too. @param {LabelsAnswer} changed */
export function accept(changed) {
  const labels = get("labels");
  if (labels && changed.revision === labels.revision + 1) set("labels", merged(labels, changed));
  else if (labels && changed.revision > labels.revision) refresh(undefined);
}

/** Ask again, whatever is known. */
export const look = () => refresh(undefined);
