/** Drawing style of a label: colour by role, line style by state. */
import { color, onImage, ui } from "../../core/colors.js";
import { get } from "../../core/store.js";
import { leadAt, shown, trackOf } from "../state/labels.js";
import { isSure } from "../state/threshold.js";

/**
 * @typedef {{tint: string, dash: number[], width: number, isLead: boolean, isChosen: boolean, isFacing: boolean,
 *   name: string, number: string, role: "cipv"|"path"|"fused"|"warning"}} Look
 *   isFacing: front and rear are told apart; role: of its colour
 */

/** @param {number} id @param {boolean} isOnImage @returns {Look|null} null if hidden */
export function lookOf(id, isOnImage) {
  const track = trackOf(id),
    isChosen = id === get("track");
  if (!track || (!isChosen && (track.state === "rejected" || !isSure(track)))) return null;
  const isLead = leadAt(shown())?.lead === id,
    unclear = track.heading === "unknown" ? " ⇅?" : "";
  const shade = (/** @type {string} */ role) => (isOnImage ? onImage(role) : color(role));
  const role =
    track.state === "rejected" ? "warning" : isLead ? "cipv" : track.state === "proposed" ? "path" : "fused";
  return {
    tint: track.state === "rejected" ? ui("danger") : shade(role),
    role,
    dash: track.state === "proposed" ? [5, 4] : track.state === "rejected" ? [2, 4] : [],
    width: isChosen ? 2.5 : 1.5,
    isLead,
    isChosen,
    isFacing: track.heading !== "unknown",
    name: `${isLead ? "lead " : ""}#${id} ${track.label}${unclear}`,
    number: `#${id}${unclear}`,
  };
}
