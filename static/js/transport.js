/** Play, step, seek, speed and loop. The bar asks; the stream answers. */
import { playback } from "./api.js";
import { $, el, text } from "./dom.js";
import { clock } from "./format.js";
import { icon } from "./icons.js";
import { get, on } from "./store.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const parts = {};
let dragging = false;

export function setUp() {
  parts.playIcon = icon("play");
  parts.pauseIcon = icon("pause");
  parts.back = button("Step back", "One frame back (←)", () => playback({ step: -1 }), icon("back"));
  parts.play = button("Play", "Play or pause (space)", togglePlay, parts.playIcon, parts.pauseIcon);
  parts.play.classList.add("play");
  parts.next = button("Step forward", "One frame on (→)", () => playback({ step: 1 }), icon("next"));
  parts.seek = el("input", { type: "range", class: "seek", min: 0, max: 0, step: 1, value: 0, aria: { label: "Frame" } });
  parts.name = el("span", { class: "name", title: "The recording's own name of this frame" });
  parts.count = el("span", { class: "dim" });
  parts.time = el("span");
  parts.speed = el("select", { title: "Speed ([ and ])", aria: { label: "Speed" }, onchange: () => playback({ speed: Number(parts.speed.value) }) },
    ...SPEEDS.map((s) => el("option", { value: s, textContent: `${s}×` })));
  parts.loop = el("button", { type: "button", class: "toggle", textContent: "Loop", title: "Start again at the end (L)", onclick: toggleLoop });
  $("#transport").append(parts.back, parts.play, parts.next, parts.seek, el("span", { class: "where" }, parts.name, parts.count, parts.time), parts.speed, parts.loop);
  parts.seek.addEventListener("input", () => {
    dragging = true;
    fillTrack();
    playback({ seek: Number(parts.seek.value) });
  });
  parts.seek.addEventListener("change", () => (dragging = false));
  on(["state"], update);
}

function button(label, title, act, ...icons) {
  return el("button", { type: "button", class: "icon-button", title, aria: { label }, onclick: act }, ...icons);
}

export function togglePlay() {
  playback({ playing: !get("state")?.playing });
}

export function toggleLoop() {
  playback({ loop: !get("state")?.loop });
}

/** The next speed up or down. @param {1|-1} direction */
export function shiftSpeed(direction) {
  const at = SPEEDS.indexOf(get("state")?.speed ?? 1);
  const next = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, (at < 0 ? 3 : at) + direction))];
  playback({ speed: next });
}

function fillTrack() {
  const share = parts.seek.max > 0 ? parts.seek.value / parts.seek.max : 0;
  parts.seek.style.setProperty("--fill", `${100 * share}%`);
}

function update() {
  /** @type {import("./types.js").State} */
  const state = get("state");
  const has = state.count > 0;
  for (const part of [parts.back, parts.play, parts.next, parts.seek, parts.speed, parts.loop]) part.disabled = !has;
  parts.playIcon.classList.toggle("is-off", state.playing);
  parts.pauseIcon.classList.toggle("is-off", !state.playing);
  parts.play.setAttribute("aria-label", state.playing ? "Pause" : "Play");
  parts.seek.max = Math.max(0, state.count - 1);
  if (!dragging) parts.seek.value = state.index;
  parts.seek.setAttribute("aria-valuetext", `frame ${state.frame ?? ""}, ${clock(state.time_s)}`);
  fillTrack();
  text(parts.name, state.frame ?? "");
  text(parts.count, has ? `${state.index + 1}/${state.count}` : "");
  text(parts.time, `${clock(state.time_s)} / ${clock(state.duration_s)}`);
  if (document.activeElement !== parts.speed) parts.speed.value = String(state.speed);
  parts.loop.setAttribute("aria-pressed", String(state.loop));
}
