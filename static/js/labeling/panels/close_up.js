/** A track from close by: its image and its points from above, the side and behind; in review, as a filmstrip. */
import { newestOnly, request } from "../../core/api.js";
import { el, text } from "../../core/dom.js";
import { seekTo } from "../../drive/seek.js";
import { get, paint } from "../../core/store.js";
import { isReviewing } from "../acts/review.js";
import { presentOf } from "../state/draft.js";
import { chosen, shown } from "../state/labels.js";

/** @typedef {import("../state/types.js").Still} Still */

const here = el("img", { class: "close-up", alt: "The selected label: image, and its points from top, side and rear" });
const strip = el("div", { class: "filmstrip", hidden: true, aria: { label: "Filmstrip" } });
export const node = el("div", { class: "close-ups" }, here, strip);
/** What the strip shows. */
let key = "";

const fetchStrip = newestOnly(async (/** @type {{id: number, revision: number}} */ { id, revision }) => {
  /** @type {Still[]} */
  const stills = await request(`api/labels/tracks/${id}/filmstrip`).catch(() => []);
  const track = chosen();
  if (track?.id !== id || track.revision !== revision) return;
  strip.replaceChildren(...stills.map((each) => still(id, revision, each)));
  mark();
});

export function setUp() {
  paint(["track", "labels", "labelFrames", "frame", "draft", "labeling"], show);
}

function show() {
  const track = chosen();
  if (!get("labeling")?.on || !track) return;
  const isHere = presentOf(track.id) !== null,
    source = isHere ? urlOf(track.id, track.revision, shown()) : "";
  here.hidden = !isHere;
  if (isHere && !get("draft") && here.getAttribute("src") !== source) here.src = source;
  strip.hidden = !isReviewing();
  const wanted = isReviewing() ? `${track.id} ${track.revision}` : "";
  if (wanted !== key) strip.replaceChildren();
  if (wanted && wanted !== key) fetchStrip({ id: track.id, revision: track.revision });
  key = wanted;
  mark();
}

/** Mark the still of the current frame. */
function mark() {
  for (const each of strip.querySelectorAll("button"))
    each.classList.toggle("is-here", each.dataset.frame === String(shown()));
}

/** @param {number} id @param {number} revision so that a changed track is fetched again @param {number} frame */
const urlOf = (id, revision, frame) => `api/labels/tracks/${id}/close_up?frame=${frame}&revision=${revision}`;

/** @param {number} id @param {number} revision @param {Still} still */
function still(id, revision, { frame, why, inside, beside }) {
  const words = el("span", {});
  text(words, `${frame + 1} · ${why}${inside === null ? "" : ` · ${inside} points in, ${beside} beside`}`);
  return el(
    "button",
    { type: "button", data: { frame: String(frame), why }, title: "Go to this frame", onclick: () => seekTo(frame) },
    el("img", { src: urlOf(id, revision, frame), alt: "", loading: "lazy" }),
    words,
  );
}
