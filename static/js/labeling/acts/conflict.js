/** Conflict dialog: two people changed the same label; shows both versions and lets the user choose. */
import { request } from "../../core/api.js";
import { el } from "../../core/dom.js";
import { open } from "../panels/dialogs.js";
import { based } from "./revisions.js";

/** @typedef {import("../state/types.js").Act} Act */

/**
 * Returns the act rebased on the other person's change, or null to keep theirs.
 * @param {Act} act
 * @param {string} sentence what the server says
 * @param {{kind: import("../state/types.js").ItemKind, id: number}} item which they changed
 * @param {any} theirs the item as it is now
 * @returns {Promise<Act|null>}
 */
export async function choose(act, sentence, item, theirs) {
  const place =
    typeof act.track === "number" && typeof act.frame === "number" ? await placeOf(act.track, act.frame) : null;
  const body = el(
    "div",
    {},
    el("p", { textContent: sentence }),
    el(
      "div",
      { class: "conflict" },
      side("Yours", act),
      side("Theirs", { ...theirs, cuboid: place?.cuboid, bbox: place?.bbox }),
    ),
  );
  return open("Two people changed the same label", body, null, [
    ["Use theirs", null],
    [
      "Keep mine",
      () => based(act, (ref) => (ref.kind === item.kind && ref.id === item.id ? theirs.revision : ref.revision)),
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
];

/** Fields displayed counting from 1. */
const FRAMES = ["frame", "first", "last"];

/** Display names of acts. @type {Record<string, string>} */
const ACTS = {
  set_sighting: "position",
  drop_keyframe: "no keyframe",
  drop_sightings: "not here",
  size_along: "size",
  refit: "fit to points",
  relabel: "class",
  trim_lead: "range end",
};

/** @param {string} title @param {Record<string, any>} item */
function side(title, item) {
  const rows = Object.entries(item).filter(
    ([key, value]) => !HIDDEN.includes(key) && value !== null && value !== undefined && value !== "",
  );
  return el(
    "div",
    {},
    el("h3", { textContent: item.kind ? `${title}: ${ACTS[item.kind] ?? item.kind.replaceAll("_", " ")}` : title }),
    el(
      "dl",
      { class: "facts-list" },
      ...rows.flatMap(([key, value]) => [
        el("dt", { textContent: { bbox: "box" }[key] ?? key.replaceAll("_", " ") }),
        el("dd", { textContent: words(FRAMES.includes(key) ? value + 1 : value) }),
      ]),
    ),
  );
}

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
