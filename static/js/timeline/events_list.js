/** The list of events. A click seeks to an event; events at the current frame are highlighted. */
import { request } from "../core/api.js";
import { $, el, text } from "../core/dom.js";
import { seekTo } from "../drive/seek.js";
import { clock } from "../core/format.js";
import { refused } from "../panels/notices.js";
import { get, on, paint, set } from "../core/store.js";
import { oneTabStop } from "../keys/one_tab_stop.js";
import { nameOf, styleOf, weightOf } from "./lanes/flags.js";

/** @typedef {import("../drive/types.js").DriveEvent} DriveEvent */

const list = $("#events-list"),
  keepTabStop = oneTabStop(list, ".event");
/** @type {{event: DriveEvent, row: HTMLElement}[]} */
let rows = [];
/** @type {DriveEvent[]|null} */
let shown = null;
/** @type {DriveEvent[]} */
const EMPTY = [];
const none = el("p", { class: "facts pad" });

export function setUp() {
  paint(["drive", "state"], build);
  paint(["theme"], recolour);
  on(["state"], reflect);
  $("#mark-button").addEventListener("click", addMark);
}

/** Mark the current frame. */
export function addMark() {
  request("api/marks", "POST", { index: get("state")?.index ?? 0, text: "" }).catch(refused);
}

function recolour() {
  shown = null;
  build();
}

function build() {
  const events = get("drive")?.events ?? EMPTY;
  text($("#events-facts"), String(events.length));
  if (events === shown) return;
  shown = events;
  rows = events.map((event) => ({ event, row: rowOf(event) }));
  list.replaceChildren(...rows.map(({ row }) => row));
  if (!rows.length) list.append(none);
  keepTabStop();
  reflect();
}

function nothing() {
  const state = get("state");
  if (state?.live) return "Marks appear here. Events are detected in recordings only.";
  if (state?.drive?.phase === "failed") return "Not searched: the run over the drive failed.";
  const isSearched = state && state.drive.run !== null && !state.drive.running; // no run yet: the pipeline is starting
  return isSearched ? "No events in this recording." : "Searching …";
}

/** @param {DriveEvent} event */
function rowOf(event) {
  const go = el(
    "button",
    {
      type: "button",
      class: "event",
      title: event.text,
      style: styleOf(weightOf(event)),
      onclick: () => jump(event),
    },
    el("i", { title: weightOf(event).words, aria: { role: "img", label: weightOf(event).words } }),
    el("span", { class: "when", textContent: clock(event.t_s) }),
    el("b", { textContent: nameOf(event) }),
    el("span", { class: "what", textContent: event.text }),
  );
  go.disabled = get("state")?.live === true; // live data cannot be rewound
  if (event.mark === null) return go;
  const remove = el("button", {
    type: "button",
    class: "drop",
    textContent: "✕",
    aria: { label: `Remove mark at ${clock(event.t_s)}` },
    onclick: () => request(`api/marks/${event.mark}`, "DELETE").catch(refused),
  });
  return el("div", { class: "event-row" }, go, remove);
}

/** Seek to an event and select its object. @param {DriveEvent} event */
function jump({ index, ids }) {
  seekTo(index);
  if (ids.length) set("selection", ids[0]);
}

function reflect() {
  const state = get("state"),
    index = state?.live ? null : state?.index;
  text(none, nothing());
  for (const { event, row } of rows) {
    const isHere = event.index === index;
    if (row.classList.contains("is-here") === isHere) continue;
    row.classList.toggle("is-here", isHere);
    if (isHere) row.scrollIntoView({ block: "nearest" });
  }
}
