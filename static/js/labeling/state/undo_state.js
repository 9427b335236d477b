/**
 * Undo and redo state of this person, and the drive it refers to.
 */
import { newestOnly, request } from "../../core/api.js";
import { get, on, set } from "../../core/store.js";
import { knownName } from "./person.js";

/** @typedef {{drive: string, can_undo: boolean, can_redo: boolean}} Steps */

/** @returns {Promise<Steps>} */
async function ask() {
  const since = get("state")?.labels?.revision ?? 0;
  const { drive, can_undo, can_redo } = await request(
    `api/labels?since=${since}&person=${encodeURIComponent(knownName())}`,
  );
  return { drive: drive.id, can_undo, can_redo };
}

const look = newestOnly(async () => {
  const uri = get("state")?.uri,
    steps = await ask().catch(() => null);
  if (get("state")?.uri === uri) set("steps", steps);
});

export function setUp() {
  let uri = "",
    seen = "";
  on(["state", "person", "link"], () => {
    const state = get("state"),
      key = JSON.stringify([state?.uri, state?.labels?.revision, get("link")?.since, knownName()]);
    if (!state || key === seen) return;
    seen = key;
    if (state.uri !== uri) set("steps", null);
    uri = state.uri ?? "";
    if (state.labels) look(undefined);
  });
}

/** The drive that an act refers to; null if labeling is unavailable. @returns {Promise<string|null>} */
export async function driveNow() {
  if (!get("state")?.labels) return null;
  return (
    get("labels")?.drive ??
    get("steps")?.drive ??
    ask().then(
      ({ drive }) => drive,
      () => null,
    )
  );
}
