/** Marking a clip: in, out, clear. */
import { $, text } from "../core/dom.js";
import { here } from "../drive/seek.js";
import { clock } from "../core/format.js";
import { get, on, set } from "../core/store.js";

export function setUp() {
  $("#clip-in").addEventListener("click", markIn);
  $("#clip-out").addEventListener("click", markOut);
  $("#clip-clear").addEventListener("click", clear);
  on(["clip", "drive"], reflect);
  let uri = get("state")?.uri;
  on(["state"], () => {
    if (get("state")?.uri === uri) return;
    uri = get("state")?.uri;
    clear();
  });
  reflect();
}

export function markIn() {
  if (get("state")?.live) return;
  const last = get("clip")?.last ?? Math.max(0, (get("state")?.count ?? 1) - 1);
  set("clip", { first: here(), last: Math.max(here(), last) });
}

export function markOut() {
  if (get("state")?.live) return;
  set("clip", { first: Math.min(here(), get("clip")?.first ?? 0), last: here() });
}

export function clear() {
  if (get("clip")) set("clip", null);
}

/** The clip, else the whole drive. @returns {{first: number, last: number}} */
export function chosen() {
  return get("clip") ?? { first: 0, last: Math.max(0, (get("state")?.count ?? 1) - 1) };
}

function reflect() {
  const clip = get("clip"),
    times = get("drive")?.t_s;
  $("#clip-clear").hidden = !clip;
  const lasts = clip && times?.length ? ` · ${clock(times[clip.last] - times[clip.first])}` : "";
  text($("#clip-facts"), clip ? `frames ${clip.first + 1}–${clip.last + 1}${lasts}` : "");
}
