/**
 * Review: a second person goes through labels made by others, one by one, and approves each or sends it back with a
 * comment. Approved labels carry the reviewer's name.
 */
import { el } from "../../core/dom.js";
import { seekTo } from "../../drive/seek.js";
import { get, set } from "../../core/store.js";
import { act } from "./queue.js";
import { ahead, refOf, say } from "./commands.js";
import { ask } from "../panels/dialogs.js";
import { chosen, leadAt, leadName, nameOf, shown } from "../state/labels.js";
import { setDoneAt, setItem, setReview } from "../state/mode.js";
import { knownName, mayReview } from "../state/person.js";

/**
 * The label under review, its display name, and the comment if it was sent back before.
 * @typedef {{ref: import("../state/types.js").ItemRef, name: string, comment: string}} Target
 */

export const isReviewing = () => get("labeling")?.on === true && get("labeling")?.review === true;

export function toggleReview() {
  if (!mayReview()) return say("Requires the role reviewer");
  setReview(!isReviewing());
  if (isReviewing()) begin();
}

/** Go to the first unreviewed label from the current frame on, else from the start. */
async function begin() {
  if (!(await step(shown() - 1, 1, ""))) await step(-1, 1, "", true);
}

/** Go to the next unreviewed label, in this frame or beyond. @param {1|-1} direction */
export async function nextUnreviewed(direction) {
  const item = get("labeling")?.item,
    after = item ? `&after_kind=${item.kind}&after_id=${item.id}` : "";
  await step(get("scrub") ?? shown(), direction, after, true);
}

/**
 * @param {number} frame
 * @param {1|-1} direction
 * @param {string} after
 * @param {boolean} [isLast] whether to report that there is none
 * @returns {Promise<boolean>}
 */
async function step(frame, direction, after, isLast = false) {
  const found = await ahead(
    "unreviewed",
    Math.max(-1, frame),
    direction,
    `${after}&person=${encodeURIComponent(knownName())}`,
  );
  if (found instanceof Error) {
    say(found.message);
    return true;
  }
  setDoneAt(found.left ? null : (get("labels")?.revision ?? null));
  if (found.frame === null || !found.item) {
    if (isLast)
      say(
        found.left
          ? `${found.left} left to review ${direction > 0 ? "before" : "after"} this frame`
          : "No labels from others left to review",
      );
    return false;
  }
  set("track", found.item.kind === "track" ? found.item.id : null);
  setItem(found.item);
  seekTo(found.frame);
  say(`${found.left} to review: ${found.why}`);
  return true;
}

/**
 * The label under review: the selected track, else the current review item, else the lead range at this frame if it
 * awaits review.
 * @returns {Target|null}
 */
export function target() {
  const track = chosen(),
    labels = get("labels"),
    item = get("labeling")?.item;
  if (track) return { ref: refOf(track), name: nameOf(track), comment: track.comment };
  const path = item?.kind === "path" ? labels?.paths.find(({ id }) => id === item.id) : null;
  const event = item?.kind === "event" ? labels?.events.find(({ id }) => id === item.id) : null;
  if (path)
    return {
      ref: { kind: "path", id: path.id, revision: path.revision },
      name: `path in frame ${path.frame + 1}`,
      comment: path.comment,
    };
  if (event)
    return {
      ref: { kind: "event", id: event.id, revision: event.revision },
      name: `${event.kind.replace("_", "-")} in frame ${event.frame + 1}`,
      comment: event.comment,
    };
  const lead = leadAt(shown());
  if (!lead || !awaitsReview(lead)) return null;
  return {
    ref: { kind: "lead", id: lead.id, revision: lead.revision },
    name: `lead ${leadName(lead.lead)}, frames ${lead.first + 1}–${lead.last + 1}`,
    comment: lead.comment,
  };
}

/** Not this person's own. @param {import("../state/types.js").LeadRange} lead */
const awaitsReview = ({ state, reviewer, origin }) =>
  (state === "accepted" || state === "corrected") &&
  !reviewer &&
  !(origin.maker === "person" && origin.name === knownName()) &&
  get("labels")?.revision !== get("labeling")?.doneAt;

/** Approve the label under review. */
export async function reviewOk() {
  const under = target();
  if (!under) return say("No label selected, and no lead to review in this frame");
  if ((await act({ kind: "review_ok", items: [under.ref] })) && isReviewing()) await goOn();
}

export async function sendBack() {
  const under = target();
  if (!under) return say("No label selected, and no lead to review in this frame");
  const comment = await ask(
    "Send back",
    el("p", { textContent: `${under.name} goes back to its annotator.` }),
    "Comment",
    under.comment,
    1000,
  );
  if (comment && (await act({ kind: "send_back", items: [under.ref], comment })) && isReviewing()) await goOn();
}

/** Go to the next label; the last message stays visible beside the new one. */
async function goOn() {
  const done = get("said");
  setItem(null);
  set("track", null);
  await begin();
  say([done, get("said")].filter(Boolean).join(" · "));
}
