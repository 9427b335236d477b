/** Urgency levels of time to collision, and names of ACC states. */

export const TTC_DANGER_S = 2.5;
const TTC_WARN_S = 5;

/** @param {number|null|undefined} ttc_s @returns {"danger"|"warn"|"none"} */
export function urgencyOf(ttc_s) {
  const left_s = ttc_s ?? Infinity;
  return left_s < TTC_DANGER_S ? "danger" : left_s < TTC_WARN_S ? "warn" : "none";
}

/** @type {Record<import("./types.js").AccState, string>} */
export const ACC_WORDS = {
  cruise: "Cruise",
  follow: "Follow",
  stop: "Stop",
  warn: "Warn",
  partial_brake: "Partial brake",
  full_brake: "Full brake",
};
