/**
 * Strips of the CIPV's figures over the whole recording, as far as it was run. A value computed with
 * older parameters is drawn fainter, so that before and after can be compared. A click goes to that place.
 */
import { playback, request } from "./api.js";
import { color, ui } from "./colors.js";
import { fitted } from "./dom.js";
import { get, on, painter } from "./store.js";

/** What each strip shows, and the least height of its scale. */
const STRIPS = {
  distance: { value: (cipv) => cipv.distance_m, low: 0, high: 40 },
  closing: { value: (cipv) => (cipv.closing_speed_mps === null ? null : cipv.closing_speed_mps * 3.6), low: -10, high: 10 },
  ttc: { value: (cipv) => (cipv.ttc_s === null ? null : Math.min(cipv.ttc_s, 20)), low: 0, high: 10 },
};

/** Frames may have been skipped while playing: samples this near to each other are still joined by a line. */
const JOINED_S = 0.6;

/** @typedef {{id: number, distance_m: number, closing_speed_mps: number|null, ttc_s: number|null}} Figures */
/** @type {Map<number, {cipv: Figures|null, revision: number}>} */
const seen = new Map();
let uri = null;
/** @type {(() => void)[]} */
const strips = [];

export function setUp() {
  on(["frame"], remember);
}

/** @param {keyof STRIPS} key @param {HTMLCanvasElement} canvas */
export function addStrip(key, canvas) {
  const draw = painter(() => drawStrip(key, canvas));
  on(["frame", "theme"], draw);
  strips.push(draw);
  new ResizeObserver(draw).observe(canvas);
  canvas.addEventListener("click", (event) => {
    const count = get("state")?.count ?? 0;
    if (count) playback({ seek: Math.min(count - 1, Math.floor((event.offsetX / canvas.clientWidth) * count)) });
  });
}

function remember() {
  const { state, result } = get("frame");
  if (state.uri !== uri) {
    uri = state.uri;
    seen.clear();
    catchUp();
  }
  seen.set(state.index, { cipv: result.cipv, revision: state.params_revision });
}

/** What the server ran before this page came. */
async function catchUp() {
  const history = await request("api/history").catch(() => null);
  if (history?.uri !== uri) return;
  for (const [index, revision, id, distance_m, closing_speed_mps, ttc_s] of history.samples) {
    if (!seen.has(index)) seen.set(index, { cipv: id === null ? null : { id, distance_m, closing_speed_mps, ttc_s }, revision });
  }
  for (const draw of strips) draw();
}

function drawStrip(key, canvas) {
  const { ctx, width, height } = fitted(canvas);
  const frame = get("frame");
  if (!frame || !width) return;
  const { count, index, params_revision, rate_hz } = frame.state;
  const { value, low, high } = STRIPS[key];
  const samples = [...seen].sort(([a], [b]) => a - b).map(([at, { cipv, revision }]) => ({ at, value: cipv && value(cipv), revision, id: cipv?.id }));
  const values = samples.map((s) => s.value).filter((v) => v !== null);
  const bottom = Math.min(low, ...values), top = Math.max(high, ...values);
  const X = (at) => ((at + 0.5) / count) * width;
  const Y = (v) => height - 3 - ((v - bottom) / (top - bottom)) * (height - 6);
  if (bottom < 0) line(ctx, 0, Y(0), width, Y(0), color("grid"));
  const joined = Math.max(2, Math.ceil(JOINED_S * rate_hz));
  ctx.lineWidth = 1.5;
  for (let i = 0; i < samples.length; i++) {
    const a = samples[i - 1], b = samples[i];
    if (b.value === null) continue;
    ctx.strokeStyle = ctx.fillStyle = color("cipv");
    ctx.globalAlpha = b.revision === params_revision ? 0.95 : 0.35;
    if (a && a.value !== null && a.id === b.id && b.at - a.at <= joined) line(ctx, X(a.at), Y(a.value), X(b.at), Y(b.value));
    else ctx.fillRect(X(b.at) - 1, Y(b.value) - 1, 2, 2);
  }
  ctx.globalAlpha = 1;
  line(ctx, X(index), 0, X(index), height, ui("accent"));
}

function line(ctx, x1, y1, x2, y2, style) {
  if (style) ctx.strokeStyle = style;
  ctx.beginPath();
  ctx.moveTo(x1, y1);
  ctx.lineTo(x2, y2);
  ctx.stroke();
}
