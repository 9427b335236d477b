/**
 * The lanes of the timeline, from the top. A lane is one module that exports a `Lane`; it appears once it is in the
 * list below, or once a part of the page adds it with `addLane`.
 */
import { set } from "../../core/store.js";
import { CURVES } from "../curves.js";
import { comparedLead } from "./compared_lead.js";
import { curveLane } from "./curve.js";
import { differences } from "./differences.js";
import { flags } from "./flags.js";
import { lead } from "./lead.js";

/** @typedef {import("../span.js").Span} Span */
/** @typedef {import("../rows.js").Row} Row */
/** @typedef {import("../../core/store.js").Key} Key */
/**
 * @typedef {{span: Span, row: Row, isLight: boolean, rowOf: (key: string) => Row|null}} Place where a lane is drawn
 */
/** @typedef {{name: string, value: string, tint: string}} Label  what stands left of the plot at a frame */
/**
 * @typedef {object} Lane
 * @property {string} key unique
 * @property {() => number} height CSS pixels, the least height of a growing lane; 0 hides the lane
 * @property {boolean} [grows] whether it shares the height that other lanes leave
 * @property {boolean} [isRuled] whether a thin line separates it from the lane above
 * @property {(ctx: CanvasRenderingContext2D, place: Place) => void} draw clipped to the plot; drawn from the lowest
 *   lane up
 * @property {(index: number, isLight: boolean) => Label} [label] name and value at a frame
 * @property {(ctx: CanvasRenderingContext2D, place: Place) => void} [drawFront] what the pointer is changing, on top
 * @property {(span: Span, x: number) => import("../pointer.js").Act|null} [press] what a drag does; null seeks
 * @property {(span: Span, x: number) => void} [click] what a click does, besides seeking
 * @property {(span: Span, x: number) => string} [cursor] CSS cursor, "" for the default
 * @property {Key[]} [redrawOn] store keys that `draw` depends on, besides drive, curve, selection and theme
 * @property {Key[]} [frontOn] store keys that `drawFront` depends on
 */

/** @type {Lane[]} */
const LANES = [flags, lead, differences, comparedLead, ...CURVES.map(curveLane)];

/** @returns {readonly Lane[]} from the top */
export const lanes = () => LANES;

/** Add a lane at the bottom, or above another one. @param {Lane} lane @param {string} [before] key of that one */
export function addLane(lane, before) {
  const at = LANES.findIndex(({ key }) => key === before);
  LANES.splice(at < 0 ? LANES.length : at, 0, lane);
  set("lanes", LANES.length);
}
