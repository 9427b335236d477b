/**
 * Pointer input on the camera in labeling mode: select labels, draw and edit boxes, point at missed vehicles.
 */
import { place } from "../../views/camera.js";
import { $ } from "../../core/dom.js";
import { get, set } from "../../core/store.js";
import { act } from "../acts/queue.js";
import { mergeWith } from "../acts/commands.js";
import { drop, hold, present, presentOf, release } from "../state/draft.js";
import { chosen, shown } from "../state/labels.js";
import { lookOf } from "./style.js";
import { isOn, setTool } from "../state/mode.js";
import { newLabel } from "../state/new_class.js";
import { boxOf, isFollowing } from "./image_drawing.js";
import { isZoomed, pan, zoom } from "../../views/image_zoom.js";
import * as road from "./road_drag.js";

/** @typedef {import("../state/types.js").Box} Box */
/** A pixel of the full camera image. @typedef {{u: number, v: number}} Pixel */
/** Which sides of a box move: left, top, right, bottom. @typedef {[boolean, boolean, boolean, boolean]} Sides */
/** @typedef {{from?: Pixel, moved: (to: Pixel) => void, ended: (isClick: boolean) => void}} Drag */

const REACH_PX = 6,
  CLICK_PX = 4;
const canvas = $("#camera", HTMLCanvasElement);

export function setUp() {
  /** @type {{x: number, y: number, hasMoved: boolean, drag: Drag|null}|null} */
  let down = null;
  canvas.addEventListener("pointerdown", (event) => {
    if (!event.isPrimary) {
      down = null; // a second finger zooms
      drop();
    }
    if (!isOn() || get("taping") || event.button !== 0 || !event.isPrimary) return;
    canvas.setPointerCapture(event.pointerId);
    down = { x: event.offsetX, y: event.offsetY, hasMoved: false, drag: takes(pixelAt(event)) };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!down || !event.isPrimary) return;
    if (!down.drag && down.hasMoved && isZoomed()) pan(event.movementX, event.movementY);
    down.hasMoved ||= Math.hypot(event.offsetX - down.x, event.offsetY - down.y) >= CLICK_PX;
    if (down.hasMoved) down.drag?.moved(pixelAt(event));
  });
  canvas.addEventListener("pointerup", (event) => {
    const held = down;
    down = null;
    if (!held) return;
    if (held.drag) held.drag.ended(!held.hasMoved);
    if (!held.hasMoved && !held.drag) clicked(pixelAt(event));
  });
  canvas.addEventListener("pointercancel", () => {
    down = null;
    drop();
  });
}

/** Zoom at the selected label, else at the middle. @param {number} by */
export function zoomBy(by) {
  const box = boxOf(get("track") ?? -1);
  zoom(by, box && { u: (box[0] + box[2]) / 2, v: (box[1] + box[3]) / 2 });
}

/** Camera pixels per canvas pixel. */
const perPane = () => 1 / (place().scale * (get("frame")?.image?.scale ?? 1));

/** @param {PointerEvent} event @returns {Pixel} */
function pixelAt({ offsetX, offsetY }) {
  return { u: (offsetX - place().x) * perPane(), v: (offsetY - place().y) * perPane() };
}

/** @param {Pixel} from @returns {Drag|null} */
function takes(from) {
  const tool = get("labeling")?.tool,
    track = chosen()?.id ?? null;
  if (tool === "new") return drawing(from, (bbox) => lift(bbox ? { bbox } : { pixel: [from.u, from.v] }));
  if (tool === "shape" && track !== null) return drawing(from, (bbox) => (bbox ? shape(track, bbox) : drop()));
  if (track === null) return null;
  const label = presentOf(track),
    box = label && !isFollowing(label) ? label.bbox : null, // one that follows is drawn anew (Shift G)
    sides = box ? sidesAt(box, from, REACH_PX * perPane()) : null;
  if (!sides || sides.every(Boolean)) {
    const onRoad = road.takes(track, from);
    if (onRoad) return { ...onRoad, ended: (isClick) => (isClick ? clicked(from) : onRoad.ended()) };
  }
  if (!box || !sides) return null;
  return {
    from,
    moved: (to) => hold(track, { bbox: stretched(box, sides, to.u - from.u, to.v - from.v), box_set: true }),
    ended: (isClick) => (isClick ? clicked(from) : release()),
  };
}

/**
 * A drag that draws a box.
 * @param {Pixel} from
 * @param {(bbox: Box|null) => void} done null after a click
 * @returns {Drag}
 */
function drawing(from, done) {
  /** @type {Box} */
  let box = [from.u, from.v, from.u, from.v];
  return {
    from,
    moved: (to) => {
      box = ordered([from.u, from.v, to.u, to.v]);
      set("draft", { track: null, frame: shown(), revision: 0, cuboid: null, bbox: box, box_set: true, settled: null });
    },
    ended: (isClick) => {
      setTool(null);
      done(isClick ? null : box);
    },
  };
}

/**
 * Create a track from an image box or pixel; the server finds its cuboid.
 * @param {{bbox: Box}|{pixel: number[]}} from
 */
async function lift(from) {
  const answer = await act({ kind: "lift", frame: shown(), label: newLabel(), ...from });
  drop();
  const made = answer?.changed?.tracks[0]?.id;
  if (made !== undefined) set("track", made);
}

/** @param {number} track @param {Box} bbox */
function shape(track, bbox) {
  drop();
  hold(track, { bbox, box_set: true });
  release();
}

/**
 * Sides of the box grabbed at a pixel: all of them inside, null outside.
 * @param {Box} box
 * @param {Pixel} pixel
 * @param {number} reach
 * @returns {Sides|null}
 */
function sidesAt([x1, y1, x2, y2], { u, v }, reach) {
  if (u < x1 - reach || u > x2 + reach || v < y1 - reach || v > y2 + reach) return null;
  const near = /** @type {Sides} */ ([u - x1 < reach, v - y1 < reach, x2 - u < reach, y2 - v < reach]);
  return near.some(Boolean) ? near : [true, true, true, true];
}

/** @param {Box} box @param {Sides} sides @param {number} du @param {number} dv @returns {Box} */
const stretched = (box, sides, du, dv) =>
  ordered(/** @type {Box} */ (box.map((value, i) => (sides[i] ? value + (i % 2 ? dv : du) : value))));

/** @param {Box} box @returns {Box} */
const ordered = ([a, b, c, d]) => [Math.min(a, c), Math.min(b, d), Math.max(a, c), Math.max(b, d)];

/** @param {Pixel} pixel */
function clicked({ u, v }) {
  const area = (/** @type {Box} */ [x1, y1, x2, y2]) => (x2 - x1) * (y2 - y1),
    reach = REACH_PX * perPane();
  const hits = present().flatMap(({ track }) => {
    const box = lookOf(track, true) && boxOf(track);
    return box && sidesAt(box, { u, v }, reach) ? [{ track, box }] : [];
  });
  const id = hits.sort((a, b) => area(a.box) - area(b.box))[0]?.track ?? null;
  if (get("labeling")?.tool === "merge" && id !== null) mergeWith(id);
  else set("track", id);
}
