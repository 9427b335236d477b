/**
 * Timing: frame rate, latency, stage and detector times, skipped frames.
 */
import { serverNow } from "../core/connection.js";
import { $, el, text } from "../core/dom.js";
import { num } from "../core/format.js";
import { get, on } from "../core/store.js";

const ITEMS = [
  ["fps", "fps", "Frames drawn in the last second", ""],
  ["age", "age", "Latency from result to screen", ""],
  ["line", "pipeline", "Pipeline time per frame without the detector", "optional"],
  ["net", "detector", "Detector time per frame; 0 if cached", "optional"],
  [
    "skipped",
    "skipped",
    "Frames skipped since opening because they arrived faster than they could be processed or drawn",
    "",
  ],
];
/** @type {Record<string, HTMLElement>} */
const values = {};
/** @type {number[]} */
let painted = [];

export function setUp() {
  $("#vitals").append(
    ...ITEMS.map(([key, label, title, className]) =>
      el(
        "div",
        { title, class: className },
        el("dt", { textContent: label }),
        (values[key] = el("dd", { textContent: "–" })),
      ),
    ),
  );
  on(["frame"], () => requestAnimationFrame(afterPaint));
  on(["state"], showSkipped);
  showSkipped();
  setInterval(showRate, 500);
}

function afterPaint() {
  const frame = get("frame");
  if (!frame) return;
  painted.push(performance.now());
  text(values.age, frame.isLate ? "–" : `${num(Math.max(0, serverNow() - frame.madeUnixMs), 0)} ms`);
  text(values.line, `${num(frame.result.timing_ms.total, 1)} ms`);
  text(values.net, `${num(frame.detectMs, 0)} ms`);
  const { timing_ms: stages } = frame.result;
  $("#vitals").title = Object.entries(stages)
    .map(([stage, ms]) => `${stage} ${num(ms, 2)} ms`)
    .join("\n");
}

/** Hidden unless frames were skipped. */
function showSkipped() {
  const skipped = get("state")?.skipped ?? 0;
  text(values.skipped, String(skipped));
  $("#vitals").lastElementChild?.toggleAttribute("hidden", !skipped);
}

function showRate() {
  const now = performance.now();
  painted = painted.filter((t) => now - t < 1000);
  text(values.fps, String(painted.length));
}
