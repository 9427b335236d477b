/** Playback bar: play, step, speed, loop and record. */
import { playback } from "../core/api.js";
import { $, el, entitle, press, text } from "../core/dom.js";
import { NO_DRIVE } from "../drive/live_buffer.js";
import * as shuttle from "../drive/shuttle.js";
import { clock } from "../core/format.js";
import { icon } from "../core/icons.js";
import { recordButton } from "./record_button.js";
import { get, on } from "../core/store.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

const playIcon = icon("play"),
  pauseIcon = icon("pause");
const back = button("Step back", "Previous frame (←)", () => playback({ step: -1 }), icon("back"));
const play = button("Play", "Play or pause (Space)", togglePlay, playIcon, pauseIcon);
const next = button("Step forward", "Next frame (→)", () => playback({ step: 1 }), icon("next"));
const name = el("span", { class: "name" });
const count = el("span", { class: "dim" });
const time = el("span");
const live = el("span", { class: "tag live", textContent: "LIVE", title: NO_DRIVE, hidden: true });
const speed = el(
  "select",
  { title: "Playback speed ([ and ])", aria: { label: "Playback speed" } },
  ...SPEEDS.map((s) => el("option", { value: String(s), textContent: `${s}×` })),
);
const loop = el("button", {
  type: "button",
  class: "toggle",
  textContent: "Loop",
  title: "Loop playback (R)",
  onclick: toggleLoop,
});

export function setUp() {
  play.classList.add("play");
  speed.addEventListener("change", () => playback({ speed: Number(speed.value) }));
  const where = el("span", { class: "where" }, live, name, count, time);
  $("#transport").append(back, play, next, where, el("span", { class: "spacer" }), recordButton(), speed, loop);
  on(["state", "frame"], update);
}

/** @param {string} label @param {string} title @param {() => void} act @param {SVGElement[]} icons */
function button(label, title, act, ...icons) {
  return el("button", { type: "button", class: "icon-button", title, aria: { label }, onclick: act }, ...icons);
}

export function togglePlay() {
  if (shuttle.isReversing()) return shuttle.stop();
  playback({ playing: !get("state")?.playing });
}

export function toggleLoop() {
  playback({ loop: !get("state")?.loop });
}

/** The next speed up or down. @param {1|-1} direction */
export function shiftSpeed(direction) {
  const at = SPEEDS.indexOf(get("state")?.speed ?? 1);
  playback({ speed: SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, (at < 0 ? SPEEDS.indexOf(1) : at) + direction))] });
}

function update() {
  const state = get("state");
  if (!state) return;
  const has = state.count > 0;
  for (const part of [back, next, speed, loop]) part.disabled = !has || state.live === true;
  playIcon.classList.toggle("is-off", state.playing);
  pauseIcon.classList.toggle("is-off", !state.playing);
  play.setAttribute("aria-label", state.playing ? "Pause" : "Play");
  const frame = get("frame")?.state,
    at = frame?.uri === state.uri ? frame : state; // name of the displayed frame
  text(name, at.frame ?? "");
  entitle(name, `Frame name in the recording: ${at.frame ?? "none"}`);
  text(count, has && !state.live ? `${at.index + 1}/${state.count}` : "");
  text(time, state.live ? clock(at.time_s) : `${clock(at.time_s)} / ${clock(state.duration_s)}`);
  live.hidden = !state.live;
  if (document.activeElement !== speed) speed.value = String(state.speed);
  press(loop, state.loop);
}
