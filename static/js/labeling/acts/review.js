/**
 * Review: a second person goes through labels made by others, one by one, and approves each or sends it back with a
 * comment. Approved labels carry the reviewer's name.
 */
import { el } from "../../core/dom.js";
import { seekTo } from "../../drive/seek.js";
import { get, set } from "../../core/store.js";
import { act } from "./queue.js";
import { ahead, say } from "./commands.js";
import { ask } from "../panels/dialogs.js";
import { chosen, isAccepted, leadAt, leadName, nameOf, shown } from "../state/labels.js";
import { setItem, setReview } from "../state/mode.js";
import { knownName, mayReview } from "../state/person.js";

/**
 * The label under review, its display name, the comment if it was sent back before, and why this person cannot approve
 * it ("" if they can).
 * @typedef {{ref: import("../state/types.js").ItemRef, name: string, comment: string, refusal: string}} Target
 */

export const NOTHING = "No label selected, and no lead to review in this frame";

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
  if (track) return about("track", track, nameOf(track));
  const path = item?.kind === "path" ? labels?.paths.find(({ id }) => id === item.id) : null;
  const event = item?.kind === "event" ? labels?.events.find(({ id }) => id === item.id) : null;
  if (path) return about("path", path, `path in frame ${path.frame + 1}`);
  if (event) return about("event", event, `${event.kind.replace("_", "-")} in frame ${event.frame + 1}`);
  const lead = leadAt(shown());
  if (!lead || !awaitsReview(lead)) return null;
  return about("lead", lead, `lead ${leadName(lead.lead)}, frames ${lead.first + 1}–${lead.last + 1}`);
}

/**
 * @param {import("../state/types.js").ItemKind} kind
 * @param {{id: number, revision: number, comment: string, author: string, reviewer: string}} label
 * @param {string} name
 * @returns {Target}
 */
function about(kind, { id, revision, comment, author, reviewer }, name) {
  const me = knownName(),
    refusal = !me
      ? ""
      : author === me
        ? "Your own label: a second person must review it"
        : reviewer === me
          ? "You have already reviewed it"
          : "";
  return { ref: { kind, id, revision }, name, comment, refusal };
}

/** Not this person's own. @param {import("../state/types.js").LeadRange} lead */
const awaitsReview = (lead) => isAccepted(lead) && !lead.reviewer && lead.author !== knownName();

/** Approve the label under review. */
export async function reviewOk() {
  const under = target();
  if (!under || under.refusal) return say(under?.refusal ?? NOTHING);
  if ((await act({ kind: "review_ok", items: [under.ref] })) && isReviewing()) await goOn();
}

export async function sendBack() {
  const under = target();
  if (!under) return say(NOTHING);
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
