/** The label under review and its buttons, in the labeling bar. */
import { el, text } from "../../core/dom.js";
import * as review from "../acts/review.js";

const under = el("span", { class: "under" }),
  approve = el("button", { type: "button", textContent: "Approve", onclick: review.reviewOk }),
  sendBack = el("button", { type: "button", textContent: "Send back", onclick: review.sendBack }),
  next = el("button", { type: "button", textContent: "Find next", onclick: () => review.nextUnreviewed(1) });

export const row = el(
  "span",
  { class: "reviewing", hidden: true },
  el("b", { textContent: "Review" }),
  under,
  approve,
  sendBack,
  next,
);

/** What can be done with the label under review; without one, only to look for the next. */
export function reflect() {
  row.hidden = !review.isReviewing();
  const label = review.target();
  text(under, label?.name ?? "nothing to review here");
  under.title = label ? "" : review.NOTHING;
  approve.hidden = sendBack.hidden = !label;
  approve.disabled = label?.refusal !== "";
  approve.title = label?.refusal || "Approve and go to next (A)";
  sendBack.title = "Send back with a comment and go to next (R)";
  text(next, label ? "Skip" : "Find next");
  next.title = label ? "Skip (N)" : "Next label to review (N)";
}
