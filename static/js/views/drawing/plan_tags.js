/** Which objects have a name tag in the plan view, and where. */
import { onImage, roleOf } from "../../core/colors.js";
import { num } from "../../core/format.js";
import { isImaged } from "../../core/object_sources.js";

/** @typedef {import("../../core/types.js").FusedObject} FusedObject */
/** @typedef {Pick<import("./viewport.js").Viewport, "u"|"v">} Viewport */
/** Ids of the CIPV, the selected and the next object. @typedef {Record<"lead"|"chosen"|"next", number|null>} Ids */

/** The rank of objects that have a tag only where there is room. */
const REST = 4;

/** A lower rank comes first. @param {FusedObject} item @param {Ids} ids */
function rankOf({ id, carried, in_path }, { lead, chosen, next }) {
  const first = [id === lead, id === chosen, id === next, !carried && in_path].indexOf(true);
  return first < 0 ? REST : first;
}

/**
 * Number and distance of the lead, the selected object, the next lead and what is in the path, in this order; then of
 * what the camera sees, nearest first, where the tag covers neither an object nor another tag. Pointing at an object
 * tells the same.
 * @param {Viewport} view
 * @param {FusedObject[]} objects
 * @param {Ids} ids
 * @param {import("./text_labels.js").Labels} labels
 */
export function drawTags(view, objects, ids, labels) {
  const placed = objects.map((item) => {
    const us = (item.bev ?? []).map(([, y]) => view.u(y)),
      vs = (item.bev ?? []).map(([x]) => view.v(x));
    return { item, rank: rankOf(item, ids), left: Math.min(...us), right: Math.max(...us), top: Math.min(...vs), vs };
  });
  for (const { left, right, top, vs } of placed) labels.keepFree(left, top, right - left, Math.max(...vs) - top);
  placed.sort((a, b) => a.rank - b.rank || (a.item.distance_m ?? 1e9) - (b.item.distance_m ?? 1e9));
  for (const { item, rank, left, right, top } of placed) {
    if (rank === REST && (item.carried || !isImaged(item))) continue;
    const distance = item.distance_m === null ? "" : ` ${num(item.distance_m)}`,
      isLead = item.id === ids.lead;
    const words = isLead
      ? `CIPV #${item.id} ${distance} m`
      : `${item.id === ids.next ? "next " : ""}#${item.id}${distance}`;
    const weight = isLead ? "strong" : rank === REST ? "weak" : "must";
    labels.put(words, right + 3, top + 14, onImage(roleOf(item, ids.lead)), weight, left - 3);
  }
}
