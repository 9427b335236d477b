/** Conflict dialog: two people changed the same label; shows both versions and lets the user choose. */
import { request } from "../../core/api.js";
import { el } from "../../core/dom.js";
import { num } from "../../core/format.js";
import { isOwn } from "../../drive/own_playhead.js";
import { seekTo } from "../../drive/seek.js";
import { on } from "../../core/store.js";
import { leadName, shown, trackOf } from "../state/labels.js";
import { fromAbove, inImage, pathFromAbove, range } from "./conflict_image.js";
import { open } from "../panels/dialogs.js";
import { based } from "./revisions.js";

/** @typedef {import("../state/types.js").Act} Act */
/** @typedef {import("../../core/types.js").Point2} Point2 */

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
  const label = typeof act.track === "number" ? trackOf(act.track)?.label : undefined;
  const frame = act.frame ?? shown(),
    place = typeof act.track === "number" && theirs ? await placeOf(act.track, frame) : null,
    [mine, other] = await inPixels([ownShape(act, place), place ?? {}]);
  await comeTo(frame);
  const body = el(
    "div",
    {},
    el("p", { textContent: sentence }),
    el(
      "div",
      { class: "conflict" },
      side("Yours", { ...act, ...asSeen(act) }, ...images(act, theirs, mine, other)),
      theirs
        ? side("Theirs", { ...theirs, ...asSeen(place) }, ...images(theirs, act, other, mine))
        : el("div", {}, el("h3", { textContent: "Theirs: removed" })),
    ),
  );
  const isShape = act.kind === "set_sighting" && label !== undefined,
    keep = theirs || typeof act.seen === "number" ? rebasedOn : isShape ? asNew : null;
  return open("Two people changed the same label", body, null, [
    [keep ? "Use theirs" : "OK", null],
    ...(keep ? [/** @type {[string, () => Act]} */ (["Keep mine", keep])] : []),
  ]);

  /** @returns {Act} */
  function rebasedOn() {
    return {
      ...based(act, (ref) => (theirs && ref.kind === item.kind && ref.id === item.id ? theirs.revision : ref.revision)),
      ...(typeof act.seen === "number" ? { seen: revision, over_reviewed: Boolean(theirs?.reviewer) } : {}),
    };
  }

  /** Of a shape on a track that was removed, a new track. @returns {Act} */
  function asNew() {
    const { frame: at, cuboid, bbox } = act;
    return { kind: "add_track", label, frame: at, cuboid, bbox };
  }
}

/** Longest wait for the frame of a conflict. */
const PATIENCE_MS = 3000;

/** Called with each frame that is shown. */
let arrived = () => {};
on(["frame"], () => arrived());

/**
 * Go to the frame that the act was done in, unless the page follows others: the images show the current frame.
 * @param {number} frame
 * @returns {Promise<void>}
 */
async function comeTo(frame) {
  if (frame === shown() || !isOwn()) return;
  await new Promise((done) => {
    arrived = () => shown() === frame && done(null);
    setTimeout(done, PATIENCE_MS);
    seekTo(frame);
  });
}

/**
 * Where the act puts its track.
 * @param {Act} act
 * @param {import("../state/types.js").LabelSighting|null} place theirs
 * @returns {import("./conflict_image.js").Shape}
 */
function ownShape(act, place) {
  if (act.kind !== "flip" || !place?.cuboid) return { cuboid: act.cuboid, bbox: act.bbox, box_set: act.box_set };
  return { cuboid: { ...place.cuboid, yaw_rad: turned(place.cuboid.yaw_rad + Math.PI) } };
}

/** In −π … π. @param {number} yaw_rad */
const turned = (yaw_rad) => Math.atan2(Math.sin(yaw_rad), Math.cos(yaw_rad));

/** A box that follows its cuboid says nothing of its own. @param {any} shape */
const asSeen = (shape) =>
  shape ? { cuboid: shape.cuboid, bbox: shape.cuboid && !shape.box_set ? null : shape.bbox } : {};

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
  return shapes.map((shape) => ({
    ...asSeen(shape),
    pixels: shape.cuboid ? (pixels?.[cuboids.indexOf(shape.cuboid)] ?? null) : null,
  }));
}

/**
 * Images of one person's version beside the other's. None of another frame than the current one.
 * @param {any} item
 * @param {any} others the other's item
 * @param {import("./conflict_image.js").Shape} own
 * @param {import("./conflict_image.js").Shape} other
 * @returns {Node[]}
 */
const images = (item, others, own, other) =>
  [
    ...((item.frame ?? others?.frame ?? shown()) === shown()
      ? [fromAbove(own.cuboid, other.cuboid), inImage(own, other), pathFromAbove(item, others)]
      : []),
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
  "box_set",
];

/** Display names of acts. @type {Record<string, string>} */
const ACTS = {
  set_sighting: "position",
  drop_keyframe: "no keyframe",
  drop_sightings: "removed here",
  size_along: "size",
  refit: "fit to points",
  relabel: "class",
  trim_lead: "range end",
  set_path: "path",
  flip: "reverse",
};

/** Distances at which a line of a path is said, in metres. */
const SAID_M = [5, 20, 40];

/** @param {string} title @param {Record<string, any>} item @param {...Node} shown images */
function side(title, item, ...shown) {
  const rows = Object.entries(item).filter(
    ([key, value]) => !HIDDEN.includes(key) && value !== null && value !== undefined && words(value) !== "",
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
        el("dd", { textContent: WORDS[key]?.(value) ?? words(value) }),
      ]),
    ),
  );
}

/** In metres and degrees. @param {import("../state/types.js").Cuboid} cuboid */
function cuboidWords({ center: [x, y, z], size, yaw_rad }) {
  const sides = size.map((side) => num(side, 2)).join(" × ");
  return `x ${num(x, 2)} y ${num(y, 2)} z ${num(z, 2)} m · ${sides} m · yaw ${num((yaw_rad * 180) / Math.PI, 1)}°`;
}

/** Lateral offsets of a line of a path, in metres. @param {Point2[]} line */
function lineWords(line) {
  const said = SAID_M.flatMap((ahead) => {
    const next = line.findIndex(([x]) => x >= ahead);
    if (next < 1) return [];
    const [x0, y0] = line[next - 1],
      [x1, y1] = line[next];
    return [`${num(y0 + ((y1 - y0) * (ahead - x0)) / (x1 - x0 || 1), 2)} m at ${ahead} m`];
  });
  return said.join(" · ") || `${line.length} points`;
}

const counted = (/** @type {number} */ frame) => words(frame + 1);

/** Fields in words of their own; frames count from 1. @type {Record<string, (value: any) => string>} */
const WORDS = {
  frame: counted,
  first: counted,
  last: counted,
  lead: leadName,
  cuboid: cuboidWords,
  bbox: (box) => `${box.map((/** @type {number} */ each) => Math.round(each)).join(", ")} px`,
  left: lineWords,
  right: lineWords,
};

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
