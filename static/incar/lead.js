/** The vehicle ahead in large digits: distance, closing speed, time to collision. */
import { $, mark, text } from "../js/core/dom.js";
import { DASH, kmh, num, ttc as ttcWords } from "../js/core/format.js";
import { get, on } from "../js/core/store.js";
import { urgencyOf } from "../js/core/urgency.js";

/** The bar is full at 0 s and empty from this TTC on; its two lines mark the warning and danger limits (incar.css). */
const BAR_S = 8;
/** Below this distance, tenths of a metre are shown. */
const TENTHS_BELOW_M = 20;
const SAME_SPEED_KMH = 0.5;

const name = $("#lead-name"),
  distance = $("#distance"),
  closing = $("#closing"),
  word = $("#closing-word");
const ttc = $("#ttc"),
  ttcValue = $("#ttc-value"),
  bar = $("#ttc-bar");

export function setUp() {
  on(["frame"], update);
}

function update() {
  const result = get("frame")?.result;
  if (!result) return;
  const { cipv } = result,
    item = result.objects.find(({ id }) => id === cipv?.id);
  text(name, cipv ? `${item?.type ?? "obstacle"} ahead${item?.carried ? ", not detected" : ""}` : "No vehicle in path");
  text(distance, num(cipv?.distance_m, (cipv?.distance_m ?? 0) < TENTHS_BELOW_M ? 1 : 0));
  updateClosing(kmh(cipv?.closing_speed_mps));
  const left_s = cipv?.ttc_s ?? null;
  mark(ttc, "alarm", urgencyOf(left_s));
  text(ttcValue, left_s === null ? DASH : `${ttcWords(left_s)} s`);
  bar.style.setProperty("--fill", `${left_s === null ? 0 : 100 * Math.max(0, 1 - left_s / BAR_S)}%`);
  bar.setAttribute("aria-valuenow", String(Math.min(BAR_S, left_s ?? BAR_S)));
  bar.setAttribute("aria-valuetext", ttcValue.textContent ?? DASH);
}

/** @param {number|null} speed_kmh positive when the gap shrinks */
function updateClosing(speed_kmh) {
  const isSame = speed_kmh === null || Math.abs(speed_kmh) < SAME_SPEED_KMH;
  const goes = isSame ? "same" : speed_kmh > 0 ? "closing" : "opening";
  mark($(".closing"), "goes", goes);
  text(closing, speed_kmh === null ? DASH : num(Math.abs(speed_kmh), 0));
  text(word, speed_kmh === null || isSame ? "" : goes);
}
