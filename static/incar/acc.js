/** ACC and emergency-braking state, shown redundantly by colour, word and shape. */
import { $, mark, text } from "../js/core/dom.js";
import { DASH, kmh, num } from "../js/core/format.js";
import { get, on } from "../js/core/store.js";
import { ACC_WORDS } from "../js/core/urgency.js";

/** @typedef {import("../js/core/types.js").AccState} AccState */

const TRIANGLE = "M24 6 45 42H3z M24 19v11 M24 36v.5",
  OCTAGON = "M15 3h18l12 12v18L33 45H15L3 33V15z M15 24h18";
/** Colour tone of the band, and its icon. @type {Record<AccState|"off", {tone: string, shape: string}>} */
const LOOKS = {
  off: { tone: "off", shape: "M24 5a19 19 0 1 0 .1 0z M12 36 36 12" },
  cruise: { tone: "calm", shape: "M24 5a19 19 0 1 0 .1 0z M24 25 33 14" },
  follow: { tone: "calm", shape: "M8 40h32 M12 31v-8l4-9h16l4 9v8z M12 23h24" },
  stop: { tone: "calm", shape: "M24 5a19 19 0 1 0 .1 0z M17 16v16 M31 16v16" },
  warn: { tone: "warn", shape: TRIANGLE },
  partial_brake: { tone: "brake", shape: OCTAGON },
  full_brake: { tone: "full", shape: OCTAGON },
};

const band = $("#acc"),
  path = $("#acc-shape path", SVGElement);
const word = $("#acc-word"),
  reason = $("#acc-reason"),
  own = $("#own-speed"),
  desired = $("#desired-speed"),
  speeds = $("#acc .speeds");

export function setUp() {
  on(["frame"], update);
}

function update() {
  const result = get("frame")?.result;
  if (!result) return;
  const { acc, ego } = result,
    looks = LOOKS[acc?.state ?? "off"];
  mark(band, "tone", looks.tone);
  mark(band, "state", acc?.state ?? "off");
  if (path.getAttribute("d") !== looks.shape) path.setAttribute("d", looks.shape);
  text(word, acc ? ACC_WORDS[acc.state] : "ACC off");
  text(reason, acc ? acc.reason : "ego speed unknown");
  speeds.hidden = !ego && !acc;
  text(own, ego ? num(kmh(ego.speed_mps), 0) : DASH);
  text(desired, acc ? num(kmh(acc.desired_speed_mps), 0) : DASH);
}

/** Id of the object that ACC slows down for, or null. @param {import("../js/core/types.js").Result} result */
export const reactsTo = ({ acc }) => acc?.object_id ?? null;

/**
 * Whether ACC warns or brakes for that object, rather than just following it.
 * @param {import("../js/core/types.js").Result} result
 */
export const isAlarmed = ({ acc }) => ["warn", "partial_brake", "full_brake"].includes(acc?.state ?? "");
