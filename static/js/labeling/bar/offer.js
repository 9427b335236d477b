/** A next step that fits what just happened, as a button in the bar. It goes when it no longer fits. */
import { el, text } from "../../core/dom.js";
import { get, on, set } from "../../core/store.js";

/**
 * isOpen: whether it still fits; about: the status message that goes with it; after: the one that follows.
 * @typedef {{words: string, take: () => unknown, isOpen: () => boolean, about?: string, after?: string}} Offer
 */

const button = el("button", { type: "button", class: "offer", hidden: true, title: "Do this next", onclick: take });

export function setUp() {
  on(["offer", "drive", "state", "track", "labels", "labeling"], reflect);
  return button;
}

function reflect() {
  const offer = get("offer");
  if (offer && !(get("labeling")?.on && offer.isOpen())) {
    if (offer.about && get("said") === offer.about) set("said", (get("labeling")?.on && offer.after) || "");
    return set("offer", null);
  }
  button.hidden = !offer;
  text(button, offer?.words ?? "");
}

function take() {
  const offer = get("offer");
  set("offer", null);
  offer?.take();
}
