/** Pointer input on the timeline: click or drag to seek, scroll to zoom, Shift + scroll or two fingers to pan. */
import { seekTo } from "../drive/seek.js";
import { get, set } from "../core/store.js";
import { laneAt } from "./rows.js";

/** @typedef {import("./span.js").Span} Span */
/** @typedef {import("./rows.js").Rows} Rows */

const CLICK_PX = 4;
const ZOOM_PER_PX = 0.0018;
const GRAB_PX = 8;

/**
 * Drag handler: called on each move, and `ended` on release or cancellation.
 * @typedef {((x: number, dx: number) => void) & {ended?: (isKept: boolean) => void}} Act
 */
/**
 * @typedef {object} Hand
 * @property {Span} span
 * @property {() => Rows} rows
 * @property {() => void} zoomed
 * @property {(index: number|null) => void} hovered
 */

/** @param {HTMLCanvasElement} canvas @param {Hand} hand */
export function followPointer(canvas, hand) {
  /** @type {Map<number, {x: number, y: number}>} */
  const down = new Map();
  /** @type {{x: number, y: number, moved: boolean, act: Act}|null} */
  let drag = null;

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
    if (down.size > 1) {
      drag?.act.ended?.(false);
      return void (drag = null);
    }
    drag = { x: event.offsetX, y: event.offsetY, moved: false, act: actionAt(hand, event) };
    drag.act(event.offsetX, 0);
  });
  canvas.addEventListener("pointermove", (event) => {
    const was = down.get(event.pointerId);
    if (!was) {
      canvas.style.cursor = laneAt(hand.rows(), event.offsetY)?.lane.cursor?.(hand.span, event.offsetX) ?? "";
      return hand.hovered(event.offsetX >= hand.span.left ? hand.span.index(event.offsetX) : null);
    }
    down.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
    if (down.size === 2) pinch(hand, [...down.values()], was, { x: event.offsetX, y: event.offsetY });
    else if (drag) {
      drag.moved ||= Math.abs(event.offsetX - drag.x) >= CLICK_PX;
      drag.act(event.offsetX, event.offsetX - was.x);
    }
  });
  const lift = (/** @type {PointerEvent} */ event) => {
    down.delete(event.pointerId);
    if (drag && !drag.moved && event.type === "pointerup") click(hand, drag.x, drag.y);
    else drag?.act.ended?.(event.type === "pointerup");
    if (!down.size) drag = null;
  };
  for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) canvas.addEventListener(name, lift);
  canvas.addEventListener("pointerleave", () => hand.hovered(null));
  canvas.addEventListener("dblclick", () => {
    hand.span.fit();
    hand.zoomed();
  });
  canvas.addEventListener("wheel", (event) => onWheel(hand, event), { passive: false });
}

/** The action of a drag that begins here. @param {Hand} hand @param {PointerEvent} event @returns {Act} */
function actionAt({ span, rows, zoomed }, event) {
  const { axis, bar } = rows(),
    clip = get("clip");
  if (event.offsetY >= bar.top && !span.isWhole) {
    return (_, dx) => {
      span.pan((dx / span.width) * span.count);
      zoomed();
    };
  }
  if (event.button === 1 || event.altKey) {
    return (_, dx) => {
      span.pan(-dx / span.perFrame);
      zoomed();
    };
  }
  if (clip && event.offsetY <= axis.top + axis.height) {
    if (Math.abs(event.offsetX - span.x(clip.first)) < GRAB_PX)
      return (x) => set("clip", { first: Math.min(span.index(x), clip.last), last: clip.last });
    if (Math.abs(event.offsetX - span.x(clip.last + 1)) < GRAB_PX)
      return (x) => set("clip", { first: clip.first, last: Math.max(span.index(x), clip.first) });
  }
  const act = laneAt(rows(), event.offsetY)?.lane.press?.(span, event.offsetX);
  return act ?? ((x) => seekTo(span.index(x)));
}

/** Pass a click to the lane under it. @param {Hand} hand @param {number} x @param {number} y */
function click({ span, rows }, x, y) {
  laneAt(rows(), y)?.lane.click?.(span, x);
}

/** @param {Hand} hand @param {WheelEvent} event */
function onWheel({ span, zoomed }, event) {
  event.preventDefault();
  const along = event.shiftKey ? event.deltaY || event.deltaX : event.deltaX; // some browsers turn the wheel with Shift
  if (Math.abs(along) > Math.abs(event.shiftKey ? 0 : event.deltaY)) span.pan(along / span.perFrame);
  else span.zoom(Math.exp(event.deltaY * ZOOM_PER_PX), event.offsetX);
  zoomed();
}

/**
 * @param {Hand} hand
 * @param {{x: number, y: number}[]} fingers after the move
 * @param {{x: number}} was
 * @param {{x: number, y: number}} now the finger that moved
 */
function pinch({ span, zoomed }, fingers, was, now) {
  const other = fingers.find(({ x }) => x !== now.x) ?? now;
  const before = Math.abs(was.x - other.x),
    after = Math.abs(now.x - other.x);
  if (before > 1 && after > 1) span.zoom(before / after, (now.x + other.x) / 2);
  span.pan(-(now.x - was.x) / 2 / span.perFrame);
  zoomed();
}
