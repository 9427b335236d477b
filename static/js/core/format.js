/** Number formatting. Unknown values are shown as a dash. */

export const DASH = "–";

/** @param {number|null|undefined} value @param {number} [digits] */
export function num(value, digits = 1) {
  return value === null || value === undefined
    ? DASH
    : value
        .toFixed(digits)
        .replace(/^-(?=0(\.0*)?$)/, "")
        .replace("-", "−");
}

/** With a plus sign if positive. @param {number|null|undefined} value @param {number} [digits] */
export function signed(value, digits = 1) {
  const isPositive = value !== null && value !== undefined && Number(value.toFixed(digits)) > 0;
  return `${isPositive ? "+" : ""}${num(value, digits)}`;
}

/** m/s → km/h @param {number|null|undefined} mps */
export const kmh = (mps) => (mps === null || mps === undefined ? null : mps * 3.6);

const LONG_S = 60;

/** Time to collision; long times are capped. @param {number|null|undefined} seconds */
export const ttc = (seconds) => ((seconds ?? 0) > LONG_S ? `> ${LONG_S}` : num(seconds));

/** Seconds as m:ss.s @param {number} seconds */
export function clock(seconds) {
  const tenths = Math.round(10 * seconds),
    minutes = Math.floor(tenths / 600); // round first: 59.97 s is 1:00.0
  return `${minutes}:${((tenths - 600 * minutes) / 10).toFixed(1).padStart(4, "0")}`;
}

/** Left or right of the path's centre, in metres: "1.2 L". @param {number|null|undefined} offset */
export function side(offset) {
  if (offset === null || offset === undefined) return DASH;
  return `${Math.abs(offset).toFixed(1)} ${offset >= 0 ? "L" : "R"}`;
}

/** A share from 0 to 1, as whole percent. @param {number} share */
export const percent = (share) => `${Math.round(100 * share)} %`;
