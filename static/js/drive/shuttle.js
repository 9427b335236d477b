/** J, K and L as in video editors: reverse, pause, forward; again to speed up. */
import { playback } from "../core/api.js";
import { get, on } from "../core/store.js";
import { seekTo } from "./seek.js";

const FASTEST = 4;
/** Interval between seeks in reverse. */
const TICK_MS = 100;

/** @type {{speed: number, from: number, since: number}|null} */
let reverse = null;
let timer = 0;

export function setUp() {
  on(["state"], () => get("state")?.playing && stopReverse());
}

export function forward() {
  const state = get("state");
  if (!state) return;
  stopReverse();
  if (!state.playing) playback({ playing: true, speed: 1 });
  else playback({ speed: Math.min(FASTEST, Math.max(1, state.speed * 2)) });
}

export function stop() {
  stopReverse();
  playback({ playing: false });
}

/** The server only plays forwards, so reverse playback is a series of seeks. */
export function backward() {
  const state = get("state");
  if (!state?.count) return;
  const speed = reverse ? Math.min(FASTEST, reverse.speed * 2) : 1;
  stopReverse();
  if (state.playing) playback({ playing: false });
  reverse = { speed, from: state.index, since: performance.now() };
  timer = setInterval(() => rewind(state.rate_hz), TICK_MS);
}

/** Whether reverse playback is on. */
export const isReversing = () => reverse !== null;

function stopReverse() {
  clearInterval(timer);
  reverse = null;
}

/** @param {number} rate_hz */
function rewind(rate_hz) {
  if (!reverse) return;
  const target = reverse.from - Math.round(((performance.now() - reverse.since) / 1000) * rate_hz * reverse.speed);
  seekTo(target);
  if (target <= 0) stopReverse();
}
