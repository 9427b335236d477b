/** Covers the display when its data is stale, so that nobody drives by it. */
import { isClockKnown, serverNow } from "../js/core/connection.js";
import { $, mark, text } from "../js/core/dom.js";
import { num } from "../js/core/format.js";
import { get, on } from "../js/core/store.js";

/** @typedef {import("../js/core/types.js").State} State */
/** @typedef {import("../js/core/types.js").Frame} Frame */
/** @typedef {"fresh"|"paused"|"stale"|"lost"|"waiting"} Kind */

const CHECK_MS = 50;
/** One missed frame is tolerated, two are not. */
const FRAMES = 3,
  LEAST_MS = 300,
  DEFAULT_HZ = 10;
const WORDS = { paused: "PAUSED", stale: "NO NEW DATA", lost: "NO CONNECTION", waiting: "WAITING" };

const root = document.documentElement,
  cover = $("#cover"),
  word = $("#cover-word"),
  why = $("#cover-why");
/** Monotonic page time when the frame arrived and when playback resumed; wall clocks may jump. */
let cameAt = -Infinity,
  wentOnAt = -Infinity;
let wasPlaying = false;
/** @type {Frame|null} */
let frame = null;

export function setUp() {
  on(["frame"], () => {
    const now = get("frame");
    // a frame resent after a reconnection, or redrawn with other parameters, is not newer
    if (now?.madeUnixMs !== frame?.madeUnixMs) cameAt = performance.now();
    frame = now;
    look();
  });
  on(["state"], () => {
    const isPlaying = get("state")?.playing === true;
    if (isPlaying && !wasPlaying) wentOnAt = performance.now();
    wasPlaying = isPlaying;
    look();
  });
  on(["link"], look);
  document.addEventListener("visibilitychange", look);
  setInterval(look, CHECK_MS);
  look();
}

/** Maximum age of a frame, in milliseconds. @param {State} state */
export function mayBeMs({ rate_hz, speed, live }) {
  return Math.max(LEAST_MS, (FRAMES * 1000) / ((rate_hz || DEFAULT_HZ) * (live ? 1 : speed)));
}

/**
 * Age of the current frame: by the server's clock, and at least the time since it arrived. Null while there is no frame
 * or the server's clock is unknown.
 */
function ageMs() {
  if (!frame || !isClockKnown()) return null;
  return Math.max(serverNow() - frame.madeUnixMs, performance.now() - cameAt);
}

/** @returns {Kind} */
function judge() {
  const state = get("state"),
    link = get("link"),
    age = ageMs();
  if (!state || !frame) return link?.status === "lost" ? "lost" : "waiting";
  if (link?.status === "lost" && (age === null || age > LEAST_MS)) return "lost";
  if (state.busy || age === null || frame.state.uri !== state.uri) return "waiting";
  if (!state.playing) return "paused";
  if (age <= mayBeMs(state)) return "fresh";
  const goesOn = !frame.state.playing && performance.now() - wentOnAt <= mayBeMs(state);
  return goesOn ? "paused" : "stale";
}

function look() {
  const kind = judge();
  mark(root, "freshness", kind);
  cover.hidden = kind === "fresh";
  if (kind === "fresh") return;
  mark(cover, "kind", kind);
  text(word, WORDS[kind]);
  text(why, reasonOf(kind));
}

/** @param {Exclude<Kind, "fresh">} kind */
function reasonOf(kind) {
  const age = ageMs(),
    state = get("state");
  if (kind === "paused") return state?.live ? "not live" : "";
  if (kind === "waiting") return state?.busy ?? "for the first frame";
  const since = age === null ? "" : `last frame ${num(age / 1000)} s ago`;
  if (kind === "lost") return `reconnecting · ${since}`;
  const problems = state?.notices.filter(({ level }) => level !== "info").map((notice) => notice.text) ?? [];
  return [since, slowness(), ...problems].filter(Boolean).join(" · ");
}

/** Says so if a frame takes longer to compute than it may be old. */
function slowness() {
  const state = get("state"),
    tookMs = frame ? (frame.result.timing_ms.total ?? 0) + frame.detectMs : 0;
  if (!state || tookMs <= mayBeMs(state)) return "";
  return `results are late: this computer is too slow, ${num(tookMs / 1000)} s per frame`;
}
