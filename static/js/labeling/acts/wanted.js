/** What a labeler goes to next, and how a search that finds none of it says so. */

/** @typedef {"unlabelled"|"asked"|"disagreement"|"proposed"|"sent_back"|"unreviewed"} Wanted */

/** @type {Record<Wanted, string>} */
const NAMES = {
  unlabelled: "unlabelled frame",
  asked: "queued frame",
  disagreement: "disagreement",
  proposed: "proposal",
  sent_back: "label sent back",
  unreviewed: "label to review",
};

/** @param {Wanted} what @param {1|-1} direction */
export const noneLeft = (what, direction) => `No ${NAMES[what]} ${direction > 0 ? "after" : "before"} this frame`;
