/** Colours of roles, from the palette that all views share (/palette.css). */
import { isImaged, isTrackedByTwo } from "./object_sources.js";
import { get } from "./store.js";

/** @type {Map<string, string>} */
const cache = new Map();

/** A role's colour for this theme. @param {string} role */
export const color = (role) => read(`--cipv-${role}`);

/** A role's colour on camera images. @param {string} role */
export const onImage = (role) => read(`--image-${role}`);

/** A colour of the page theme. @param {string} name */
export const ui = (name) => read(`--${name}`);

export function forget() {
  cache.clear();
}

/** @param {string} name */
function read(name) {
  const held = cache.get(name);
  if (held !== undefined) return held;
  const found = getComputedStyle(document.documentElement).getPropertyValue(name).trim() || "#888888";
  cache.set(name, found);
  return found;
}

/** @param {import("./types.js").FusedObject} item @param {number|null} cipvId */
export function roleOf(item, cipvId) {
  if (item.id === cipvId) return "cipv";
  return isTrackedByTwo(item) ? "fused" : isImaged(item) ? "vision" : "lidar";
}

/** Id of the CIPV in the current frame. */
export const cipvId = () => get("frame")?.result.cipv?.id ?? null;

/** Warm is near, cold is far; green and magenta are reserved. */
const STOPS = [
  [255, 86, 56],
  [255, 160, 30],
  [250, 226, 90],
  [150, 205, 255],
  [80, 120, 255],
  [90, 80, 200],
];
const RANGE_STEPS = 32;
export const RANGE_MAX_M = 70;

/** `RANGE_STEPS` colours [r, g, b] from 0 m to `RANGE_MAX_M`. */
export const RANGE_COLORS = Array.from({ length: RANGE_STEPS }, (_, i) => {
  const at = Math.sqrt(i / (RANGE_STEPS - 1)) * (STOPS.length - 1);
  const low = Math.min(Math.floor(at), STOPS.length - 2);
  return STOPS[low].map((c, k) => Math.round(c + (STOPS[low + 1][k] - c) * (at - low)));
});
