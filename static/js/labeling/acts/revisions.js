/** Items and revisions that an act refers to. */

/** @typedef {import("../state/types.js").Act} Act */
/** @typedef {import("../state/types.js").ItemRef} ItemRef */
/** @typedef {import("../state/types.js").ActAnswer} ActAnswer */

/** @type {Record<import("../state/types.js").ItemKind, "tracks"|"leads"|"paths"|"events"|"tags">} */
const LISTS = { track: "tracks", lead: "leads", path: "paths", event: "events", tag: "tags" };

/** @param {Act} act @returns {ItemRef[]} */
function refsOf(act) {
  const one =
    typeof act.track === "number"
      ? [{ kind: /** @type {const} */ ("track"), id: act.track, revision: act.revision }]
      : [];
  const range =
    typeof act.range === "number"
      ? [{ kind: /** @type {const} */ ("lead"), id: act.range, revision: act.revision }]
      : [];
  const two =
    Array.isArray(act.tracks) && act.kind === "merge"
      ? act.tracks.map((/** @type {any} */ each) => ({ kind: "track", ...each }))
      : [];
  return [...one, ...range, ...two, ...(act.items ?? [])];
}

/**
 * Returns the act with other revisions of its items.
 * @param {Act} act
 * @param {(ref: ItemRef) => number} revisionOf
 * @returns {Act}
 */
export function based(act, revisionOf) {
  /** @type {Act} */
  const copy = { ...act };
  if (typeof act.track === "number")
    copy.revision = revisionOf({ kind: "track", id: act.track, revision: act.revision });
  if (typeof act.range === "number")
    copy.revision = revisionOf({ kind: "lead", id: act.range, revision: act.revision });
  if (act.kind === "merge")
    copy.tracks = act.tracks.map((/** @type {any} */ each) => ({
      ...each,
      revision: revisionOf({ kind: "track", ...each }),
    }));
  if (act.items) copy.items = act.items.map((/** @type {ItemRef} */ each) => ({ ...each, revision: revisionOf(each) }));
  return copy;
}

/**
 * Rebase a waiting act on the result of an earlier one from this page. Changes by others remain conflicts; undo and
 * redo are refused if there are any.
 * @param {Act} act
 * @param {Act} earlier
 * @param {ActAnswer} answer to the earlier one
 * @returns {Act}
 */
export function rebased(act, earlier, answer) {
  const sent = refsOf(earlier),
    isMove = earlier.kind === "undo" || earlier.kind === "redo";
  return based(act, ({ kind, id, revision }) => {
    const isOwn = isMove || sent.some((each) => each.kind === kind && each.id === id && each.revision === revision);
    const list = /** @type {{id: number, revision: number}[]} */ (answer.changed?.[LISTS[kind]] ?? []);
    return isOwn && list.some((each) => each.id === id && each.revision === answer.act)
      ? /** @type {number} */ (answer.act)
      : revision;
  });
}

/**
 * Rebase a waiting act on an earlier one that was kept in a conflict.
 * @param {Act} act
 * @param {Act} before the earlier one as it was refused
 * @param {Act} kept the same, based on the other person's change
 * @returns {Act}
 */
export function rebasedOnKept(act, before, kept) {
  const old = refsOf(before),
    now = refsOf(kept);
  return based(act, ({ kind, id, revision }) => {
    const at = old.findIndex((each) => each.kind === kind && each.id === id && each.revision === revision);
    return now[at]?.revision ?? revision;
  });
}
