/** Colour modes of LiDAR points: one packed colour per point. */
import { RANGE_COLORS, RANGE_MAX_M, roleOf } from "../../core/colors.js";
import { pack, rgba } from "./dot_raster.js";

/** @typedef {import("../../core/types.js").Frame} Frame */
/** @typedef {"object"|"range"|"height"|"intensity"|"ring"|"cluster"|"ground"|"age"} ColorBy */
/** The colour of a role, in the shades of one view. @typedef {(role: string) => string} Shade */

/** @type {[ColorBy, string, string][]} name, label, what it shows */
export const COLOR_BY = [
  ["object", "Object", "By source: magenta LiDAR, violet both, green CIPV"],
  ["range", "Range", `Distance, warm (near) to cold (far): 0 to ${RANGE_MAX_M} m`],
  ["height", "Height", "Height above the fitted ground: −0.3 to 3 m"],
  ["intensity", "Intensity", "Return intensity"],
  ["ring", "Ring", "Laser ring, lowest to highest"],
  ["cluster", "Cluster", "One colour per tracked object"],
  ["ground", "Ground", "Ground and non-ground points"],
  ["age", "Age", "Age relative to the newest point of the sweep: 0 to 100 ms"],
];

export const GROUND = 0;
export const CLUSTER = 2;
const KIND_ROLES = ["ground", "unclustered", "cluster", "dropped"];
const HEIGHT_M = [-0.3, 3],
  AGE_MS = 100,
  UNKNOWN_AGE = 255;

/** Dark blue over green to yellow, with perceptually even lightness. */
const STOPS = [
  [70, 30, 110],
  [60, 90, 160],
  [40, 150, 150],
  [90, 200, 110],
  [200, 225, 60],
  [255, 240, 120],
];
const RAMP = ramp(STOPS, 256),
  RANGE_RAMP = spread(RANGE_COLORS, 256);
/** Distinct hues, without the reserved green and magenta. */
const HUES = [
  [255, 160, 60],
  [90, 190, 255],
  [240, 220, 90],
  [200, 140, 255],
  [120, 220, 220],
  [255, 120, 110],
  [170, 200, 120],
  [140, 150, 255],
  [230, 170, 200],
  [200, 180, 140],
];

/**
 * Colours (count) for `DotRaster`; ground points are fainter.
 * @param {Frame} frame @param {ColorBy} by @param {Shade} shade @param {number} [groundAlpha] @returns {Uint32Array}
 */
export function tints(frame, by, shade, groundAlpha = 0.6) {
  const { count, kind } = frame,
    found = new Uint32Array(count);
  const colorOf = MODES[by](frame, shade);
  const faint = (Math.round(groundAlpha * 255) << 24) >>> 0;
  for (let i = 0; i < count; i++) {
    const tint = colorOf(i);
    found[i] = kind[i] === GROUND ? ((tint & 0xffffff) | faint) >>> 0 : tint;
  }
  return found;
}

/** @typedef {(i: number) => number} Colorer */
/** @type {Record<ColorBy, (frame: Frame, shade: Shade) => Colorer>} */
const MODES = {
  object({ kind, owner, result }, shade) {
    const lead = result.cipv?.id ?? null,
      loose = KIND_ROLES.map((role) => rgba(shade(role), 0.8));
    const owned = [rgba(shade("cluster")), ...result.objects.map((item) => rgba(shade(roleOf(item, lead))))];
    return (i) => (kind[i] === CLUSTER ? owned[owner[i]] : loose[kind[i]]);
  },
  range({ xyz }) {
    const perStep = RANGE_MAX_M * 100;
    return (i) => RANGE_RAMP[level(Math.sqrt(xyz[3 * i] ** 2 + xyz[3 * i + 1] ** 2) / perStep)];
  },
  height({ xyz, display }) {
    const [low, high] = HEIGHT_M,
      floor = groundOf(display.ground);
    return (i) =>
      RAMP[level((xyz[3 * i + 2] / 100 - floor(xyz[3 * i] / 100, xyz[3 * i + 1] / 100) - low) / (high - low))];
  },
  intensity:
    ({ intensity }) =>
    (i) =>
      RAMP[level(Math.sqrt(intensity[i] / 255))],
  ring({ ring }) {
    const most = Math.max(
      1,
      ring.reduce((a, b) => Math.max(a, b), 0),
    );
    return (i) => RAMP[level(ring[i] / most)];
  },
  cluster({ kind, owner, result }, shade) {
    const loose = KIND_ROLES.map((role) => rgba(shade(role), 0.8));
    const owned = [loose[CLUSTER], ...result.objects.map(({ id }) => packed(HUES[(id * 7) % HUES.length]))];
    return (i) => (kind[i] === CLUSTER ? owned[owner[i]] : loose[kind[i]]);
  },
  ground({ kind }, shade) {
    const road = rgba(shade("path")),
      rest = rgba(shade("cluster")),
      dropped = rgba(shade("dropped"), 0.8);
    return (i) => (kind[i] === GROUND ? road : kind[i] === 3 ? dropped : rest);
  },
  age({ age }, shade) {
    const unknown = rgba(shade("unclustered"), 0.8);
    return (i) => (age[i] === UNKNOWN_AGE ? unknown : RAMP[255 - level(age[i] / AGE_MS)]);
  },
};

/**
 * Ground height function.
 * @param {import("../../core/types.js").GroundPlanes|null} ground
 * @returns {(x: number, y: number) => number}
 */
function groundOf(ground) {
  if (!ground) return () => 0;
  const { edges, planes } = ground;
  return (x, y) => {
    let segment = 0;
    while (segment < planes.length - 1 && x >= edges[segment + 1]) segment++;
    const [nx, ny, nz, d] = planes[segment];
    return -(d + nx * x + ny * y) / nz;
  };
}

/** @param {number} share 0–1 */
const level = (share) => (share <= 0 ? 0 : share >= 1 ? 255 : Math.floor(share * 255));

/** @param {number[]} rgb */
function packed([r, g, b]) {
  return pack(r, g, b);
}

/** @param {number[][]} stops @param {number} count */
function ramp(stops, count) {
  return Array.from({ length: count }, (_, i) => {
    const at = (i / (count - 1)) * (stops.length - 1),
      low = Math.min(Math.floor(at), stops.length - 2);
    return packed(stops[low].map((c, k) => Math.round(c + (stops[low + 1][k] - c) * (at - low))));
  });
}

/** @param {number[][]} colors @param {number} count */
function spread(colors, count) {
  return Array.from({ length: count }, (_, i) => packed(colors[Math.floor((i / count) * colors.length)]));
}
