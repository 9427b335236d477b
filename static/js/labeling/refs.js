/** Which items an act is about, and on which of their revisions it is based. */

/** @typedef {import("./types.js").Act} Act */
/** @typedef {import("./types.js").ItemRef} ItemRef */
/** @typedef {import("./types.js").LabelsAnswer} LabelsAnswer */

/** @type {Record<import("./types.js").ItemKind, "tracks"|"leads"|"paths"|"events"|"tags">} */
const LISTS = { track: "tracks", lead: "leads", path: "paths", event: "events", tag: "tags" };

/** @param {Act} act @returns {ItemRef[]} */
export function refsOf(act) {
  const one = typeof act.track === "number" ? [{ kind: /** @type {const} */ ("track"), id: act.track, revision: act.revision }] : [];
  const two = Array.isArray(act.tracks) && act.kind === "merge" ? act.tracks.map((/** @type {any} */ each) => ({ kind: "track", ...each })) : [];
  return [...one, ...two, ...(act.items ?? [])];
}

/** The act, based on other revisions of its items. @param {Act} act @param {(ref: ItemRef) => number} revisionOf @returns {Act} */
export function based(act, revisionOf) {
  /** @type {Act} */
  const copy = { ...act };
  if (typeof act.track === "number") copy.revision = revisionOf({ kind: "track", id: act.track, revision: act.revision });
  if (act.kind === "merge") copy.tracks = act.tracks.map((/** @type {any} */ each) => ({ ...each, revision: revisionOf({ kind: "track", ...each }) }));
  if (act.items) copy.items = act.items.map((/** @type {ItemRef} */ each) => ({ ...each, revision: revisionOf(each) }));
  return copy;
}

/**
 * An act that waited while this page's own earlier act changed one of its items: it is based on what that one left. Changes
 * by others stay a conflict.
 * @param {Act} act @param {ItemRef[]} sent what the earlier act was based on @param {LabelsAnswer} changed @returns {Act}
 */
export function rebased(act, sent, changed) {
  return based(act, (ref) => {
    const isOwn = sent.some((each) => each.kind === ref.kind && each.id === ref.id && each.revision === ref.revision);
    const list = /** @type {{id: number, revision: number}[]} */ (changed[LISTS[ref.kind]]);
    return (isOwn ? list.find(({ id }) => id === ref.id)?.revision : null) ?? ref.revision;
  });
}
