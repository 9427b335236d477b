/** Conflict dialog: two people changed the same label; shows both versions and lets the user choose. */
import { request } from "../../core/api.js";
import { el } from "../../core/dom.js";
import { num } from "../../core/format.js";
import { fromAbove, inImage, range } from "./conflict_image.js";
import { open } from "../panels/dialogs.js";
import { based } from "./revisions.js";

/** @typedef {import("../state/types.js").Act} Act */

/**
 * Returns the act rebased on the other person's change, or null to keep theirs.
 * @param {Act} act
 * @param {string} sentence what the server says
 * @param {{kind: import("../state/types.js").ItemKind, id: number}} item which they changed
 * @param {any} theirs the item as it is now; null if it was removed
 * @param {number} [revision] of the labels in which it is so
 * @returns {Promise<Act|null>}
 */
export async function choose(act, sentence, item, theirs, revision) {
  const isPlaced = typeof act.track === "number" && typeof act.frame === "number",
    place = isPlaced ? await placeOf(act.track, act.frame) : null,
    [mine, other] = isPlaced ? await inPixels([act, place ?? {}]) : [{}, {}];
  const body = el(
    "div",
    {},
    el("p", { textContent: sentence }),
    el(
      "div",
      { class: "conflict" },
      side("Yours", act, ...images(act, mine, other)),
      theirs
        ? side("Theirs", { ...theirs, cuboid: place?.cuboid, bbox: place?.bbox }, ...images(theirs, other, mine))
        : el("div", {}, el("h3", { textContent: "Theirs: removed" })),
    ),
  );
  return open("Two people changed the same label", body, null, [
    ["Use theirs", null],
    [
      "Keep mine",
      () => ({
        ...based(act, (ref) =>
          theirs && ref.kind === item.kind && ref.id === item.id ? theirs.revision : ref.revision,
        ),
        ...(typeof act.seen === "number" ? { seen: revision, over_reviewed: Boolean(theirs?.reviewer) } : {}),
      }),
    ],
  ]);
}

/**
 * The server's current version of a track in a frame.
 * @param {number} track
 * @param {number} frame
 * @returns {Promise<import("../state/types.js").LabelSighting|null>}
 */
async function placeOf(track, frame) {
  /** @type {import("../state/types.js").SightingsAnswer} */
  const { sightings } = await request(`api/labels/frames?first=${frame}&last=${frame}`).catch(() => ({
    sightings: {},
  }));
  return sightings[frame]?.find((each) => each.track === track) ?? null;
}

/**
 * Both shapes with their cuboids in pixels of the image.
 * @param {any[]} shapes
 * @returns {Promise<import("./conflict_image.js").Shape[]>}
 */
async function inPixels(shapes) {
  const cuboids = shapes.flatMap(({ cuboid }) => (cuboid ? [cuboid] : []));
  /** @type {{pixels: import("../../core/types.js").Pixels[]|null}} */
  const { pixels } = cuboids.length
    ? await request("api/project", "POST", { cuboids }).catch(() => ({ pixels: null }))
    : { pixels: null };
  return shapes.map(({ cuboid, bbox }) => ({
    cuboid,
    bbox,
    pixels: cuboid ? (pixels?.[cuboids.indexOf(cuboid)] ?? null) : null,
  }));
}

/**
 * Images of one person's version beside the other's.
 * @param {any} item
 * @param {import("./conflict_image.js").Shape} own
 * @param {import("./conflict_image.js").Shape} other
 * @returns {Node[]}
 */
const images = (item, own, other) =>
  [
    fromAbove(own.cuboid, other.cuboid),
    inImage(own, other),
    typeof item.first === "number" && typeof item.last === "number" ? range(item.first, item.last) : null,
  ].filter((each) => each !== null);

/** Fields that are not shown. */
const HIDDEN = [
  "kind",
  "id",
  "track",
  "range",
  "items",
  "tracks",
  "revision",
  "interpolate",
  "sightings",
  "origin",
  "keyframes",
  "seen",
  "over_reviewed",
  "confidence",
  "heading",
];

/** Fields displayed counting from 1. */
const FRAMES = ["frame", "first", "last"];

/** Display names of acts. @type {Record<string, string>} */
const ACTS = {
  set_sighting: "position",
  drop_keyframe: "no keyframe",
  drop_sightings: "removed here",
  size_along: "size",
  refit: "fit to points",
  relabel: "class",
  trim_lead: "range end",
};

/** @param {string} title @param {Record<string, any>} item @param {...Node} shown images */
function side(title, item, ...shown) {
  const rows = Object.entries(item).filter(
    ([key, value]) => !HIDDEN.includes(key) && value !== null && value !== undefined && value !== "",
  );
  return el(
    "div",
    {},
    el("h3", { textContent: item.kind ? `${title}: ${ACTS[item.kind] ?? item.kind.replaceAll("_", " ")}` : title }),
    ...shown,
    el(
      "dl",
      { class: "facts-list" },
      ...rows.flatMap(([key, value]) => [
        el("dt", { textContent: { bbox: "box" }[key] ?? key.replaceAll("_", " ") }),
        el("dd", {
          textContent: FRAMES.includes(key) ? words(value + 1) : key === "cuboid" ? cuboidWords(value) : words(value),
        }),
      ]),
    ),
  );
}

/** In metres and degrees. @param {import("../state/types.js").Cuboid} cuboid */
const cuboidWords = ({ center: [x, y, z], size, yaw_rad }) =>
  `x ${num(x, 2)} y ${num(y, 2)} z ${num(z, 2)} m · ${size.map((side) => num(side, 2)).join(" × ")} m · ` +
  `yaw ${num((yaw_rad * 180) / Math.PI, 1)}°`;

/** @param {any} value @returns {string} */
function words(value) {
  if (typeof value === "number") return String(Math.round(value * 100) / 100);
  if (Array.isArray(value)) return value.length > 8 ? `${value.length} items` : value.map(words).join(", ");
  if (value && typeof value === "object")
    return Object.entries(value)
      .map(([key, inner]) => `${key.replace("_rad", "")} ${words(inner)}`)
      .join(" · ");
  return String(value);
}
