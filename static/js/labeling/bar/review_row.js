/** The label under review and its buttons, in the labeling bar. */
import { el, text } from "../../core/dom.js";
import * as review from "../acts/review.js";

const under = el("span", { class: "under" }),
  approve = el("button", { type: "button", textContent: "Approve", onclick: review.reviewOk }),
  sendBack = el("button", { type: "button", textContent: "Send back", onclick: review.sendBack });

export const row = el(
  "span",
  { class: "reviewing", hidden: true },
  el("b", { textContent: "Review" }),
  under,
  approve,
  sendBack,
  el("button", {
    type: "button",
    textContent: "Skip",
    title: "Skip (N)",
    onclick: () => review.nextUnreviewed(1),
  }),
);

/** Buttons are enabled while they apply; otherwise their titles say why not. */
export function reflect() {
  row.hidden = !review.isReviewing();
  const label = review.target();
  text(under, label?.name ?? "nothing");
  approve.disabled = !label || label.refusal !== "";
  approve.title = label ? label.refusal || "Approve and go to next (A)" : review.NOTHING;
  sendBack.disabled = !label;
  sendBack.title = label ? "Send back with a comment and go to next (R)" : review.NOTHING;
}
