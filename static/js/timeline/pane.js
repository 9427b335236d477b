/**
 * The timeline of the whole drive. Three canvases are redrawn independently: the drive, pointer edits, and what moves
 * with the frame.
 */
import { ui } from "../core/colors.js";
import { $, el, press, text } from "../core/dom.js";
import { here } from "../drive/seek.js";
import { clock, num } from "../core/format.js";
import { get, on, paint, painter } from "../core/store.js";
import { Surface } from "../views/drawing/surface.js";
import * as clip from "./clip.js";
import { CURVES, hasData, isShown, toggleCurve } from "./curves.js";
import { drawBack, drawFront } from "./drawing.js";
import * as events from "./events_list.js";
import { nameOf } from "./lanes/flags.js";
import { lanes } from "./lanes/registry.js";
import * as live from "./live_controls.js";
import { followPointer } from "./pointer.js";
import { shareOut } from "./rows.js";
import { Span } from "./span.js";
import { drawValues, moveCursor } from "./values.js";

const LABELS_PX = 132;
const EDGE_PX = 8;

const back = $("#timeline-back", HTMLCanvasElement),
  front = $("#timeline-front", HTMLCanvasElement);
const span = new Span();
/** Lanes whose store keys are watched. @type {Set<import("./lanes/registry.js").Lane>} */
const watched = new Set();
/** @type {number|null} */
let hover = null;

const redraw = painter(draw),
  redrawFront = painter(drawHand),
  redrawValues = painter(follow);
const still = new Surface(back, redraw, "panel"),
  hand = new Surface(front, redrawFront),
  values = new Surface($("#timeline-values", HTMLCanvasElement), redrawValues);

export function setUp() {
  $("#timeline-curves").append(...CURVES.map(chip));
  on(["drive", "curve", "selection", "theme"], redraw);
  on(["lanes"], watchLanes);
  watchLanes();
  on(["state"], () => frames() !== span.count && redraw());
  on(["clip"], redrawFront);
  on(["state", "scrub"], redrawValues);
  paint(["state", "drive"], describe);
  followPointer(front, { span, rows, zoomed: redraw, hovered });
  $("#timeline-fit").addEventListener("click", fit);
  clip.setUp();
  events.setUp();
  live.setUp();
}

/** Redraw when anything changes that a lane draws. */
function watchLanes() {
  for (const lane of lanes()) {
    if (watched.has(lane)) continue;
    watched.add(lane);
    on(lane.redrawOn ?? [], redraw);
    on(lane.frontOn ?? [], redrawFront);
  }
  redraw();
}

/** Number of frames to show. */
const frames = () => Math.max(1, (get("state")?.live ? get("drive")?.count : get("state")?.count) ?? 1);

/** Show the whole drive. */
export function fit() {
  span.fit();
  redraw();
}

/** @param {1|-1} direction in or out, around the cursor */
export function zoom(direction) {
  span.zoom(direction > 0 ? 0.6 : 1 / 0.6, span.middle(here()));
  redraw();
}

/** The button that shows or hides a curve. @param {import("./curves.js").Curve} curve */
function chip(curve) {
  const style = { "--chip": `var(--cipv-${curve.role})` };
  const button = el("button", { type: "button", textContent: curve.label, title: curve.title, style, onclick: flip });
  press(button, isShown(curve));
  on(["drive"], () => {
    const isEmpty = !hasData(curve);
    if (button.disabled === isEmpty) return;
    button.disabled = isEmpty;
    button.title = isEmpty ? `${curve.title} (no data in this recording)` : curve.title;
  });
  function flip() {
    toggleCurve(curve);
    press(button, isShown(curve));
    redraw();
  }
  return button;
}

/**
 * Layout as last drawn: reading sizes and styles ten times a second would force page layouts.
 */
let shared = shareOut(0, []);
let isLight = false;
const rows = () => shared;

function draw() {
  if (still.isHidden) return;
  const ctx = still.begin(),
    { width, height } = still;
  span.setCount(frames());
  span.left = LABELS_PX;
  span.width = Math.max(1, width - LABELS_PX - EDGE_PX);
  shared = shareOut(height, [...lanes()]);
  isLight = getComputedStyle(document.documentElement).colorScheme === "light";
  drawBack(ctx, { width, height }, span, shared, isLight);
  $("#timeline-fit").hidden = span.isWhole;
  drawHand();
  follow();
}

function drawHand() {
  if (!hand.isHidden) drawFront(hand.begin(), hand, span, shared, hover, isLight);
}

/** The shown frame has changed. */
function follow() {
  const state = get("state");
  if (!state?.frame || values.isHidden) return;
  if (state.playing && span.reveal(here())) return redraw();
  moveCursor($("#timeline-cursor"), span, here());
  drawValues(values.begin(), shared, hover ?? here(), isLight, LABELS_PX);
  front.setAttribute("aria-valuemax", String(frames() - 1));
  front.setAttribute("aria-valuenow", String(here()));
  front.setAttribute("aria-valuetext", `frame ${state.frame ?? ""}, ${clock(state.time_s)}`);
}

/** @param {number|null} index */
function hovered(index) {
  if (index === hover) return;
  hover = index;
  const drive = get("drive");
  const here =
    index === null ? [] : (drive?.events ?? []).filter((event) => Math.abs(event.index - index) * span.perFrame < 8);
  const differs =
    index === null ? undefined : drive?.comparison?.differing.find(([first, last]) => index >= first && index <= last);
  const why = differs ? drive?.comparison?.first[differs[0]] : undefined;
  front.title = [...here.map((event) => `${nameOf(event)}: ${event.text}`), why].filter(Boolean).join("\n");
  redrawFront();
  redrawValues();
}

/** @param {number} done @param {number} total */
const percent = (done, total) => `${Math.round((100 * done) / Math.max(1, total))}%`;

/** Show progress of the run, and how many frames differ. */
function describe() {
  const state = get("state")?.drive,
    drive = get("drive");
  const isWhole =
    drive?.now &&
    drive.now.run === state?.run &&
    drive.now.done === drive.count &&
    drive.base?.run === (state.base === state.run ? undefined : state.base);
  $(".timeline-pane").setAttribute("aria-busy", String(!isWhole));
  const words = [];
  if (state?.running)
    words.push(`${state.phase === "detect" ? "detecting" : "computing"} ${percent(state.done, state.total)}`);
  if (state?.note) words.push(state.note);
  if (drive?.comparison)
    words.push(
      drive.comparison.frames_differing
        ? `${num(drive.comparison.frames_differing, 0)} of ${drive.count} frames differ`
        : "no frames differ",
    );
  text($("#timeline-facts"), words.join(" · "));
  $("#timeline-facts").style.color = drive?.comparison?.frames_differing ? ui("warn") : "";
}
