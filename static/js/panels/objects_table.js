/** The table of fused objects, with the reason why each is or is not the CIPV. */
import { cipvId, roleOf } from "../core/colors.js";
import { $, el, mark, text, within } from "../core/dom.js";
import { DASH, kmh, num, side, signed, ttc } from "../core/format.js";
import { LongList } from "../core/long_list.js";
import { isImaged } from "../core/object_sources.js";
import { get, on, paintAfter, select, set } from "../core/store.js";
import { oneTabStop } from "../keys/one_tab_stop.js";

/** @typedef {import("../core/types.js").FusedObject} FusedObject */
/**
 * @typedef {object} Column
 * @property {string} key
 * @property {string} label
 * @property {string} help
 * @property {(o: FusedObject) => string} words  cell text
 * @property {(o: FusedObject) => string|number} by  sort key
 */

/** @type {Column[]} */
const COLUMNS = [
  {
    key: "id",
    label: "#",
    help: "Object ID, stable while the object is tracked",
    words: (o) => `#${o.id}`,
    by: (o) => o.id,
  },
  {
    key: "source",
    label: "Seen",
    help: "Seen by: V camera, L LiDAR, VL both",
    words: (o) => o.source,
    by: (o) => o.source,
  },
  {
    key: "type",
    label: "Class",
    help: "Detector class and score",
    words: (o) => (o.type ? `${o.type} ${num(o.type_score, 2)}` : DASH),
    by: (o) => o.type ?? "~",
  },
  {
    key: "distance",
    label: "Distance",
    help: "Distance to the nearest point ± 1σ, in metres",
    words: distance,
    by: (o) => o.distance_m ?? Infinity,
  },
  {
    key: "velocity",
    label: "Closing",
    help: "Closing speed in km/h: positive while the gap shrinks",
    words: (o) => signed(kmh(closing(o))),
    by: (o) => -(closing(o) ?? -Infinity),
  },
  {
    key: "ttc",
    label: "TTC",
    help: "Time to collision in seconds; – while the gap is not shrinking",
    words: (o) => ttc(o.ttc_s),
    by: (o) => o.ttc_s ?? Infinity,
  },
  {
    key: "offset",
    label: "Offset",
    help: "Lateral offset from the path centre, metres left (L) or right (R)",
    words: (o) => side(o.path_offset_m),
    by: (o) => Math.abs(o.path_offset_m ?? Infinity),
  },
  {
    key: "inPath",
    label: "In path",
    help: "In the path corridor, with its filtered probability: yes from 50%",
    words: inPath,
    by: (o) => -(o.in_path_probability ?? Number(o.in_path)),
  },
  { key: "hits", label: "Hits", help: "Number of detections so far", words: (o) => String(o.hits), by: (o) => -o.hits },
  {
    key: "points",
    label: "Points",
    help: "LiDAR points on it",
    words: (o) => (o.lidar_points ? String(o.lidar_points) : DASH),
    by: (o) => -o.lidar_points,
  },
];
const TEXTS = new Set(["id", "source", "type"]);

/** A null key sorts by relevance. @type {{key: string|null, down: boolean}} */
let sort = { key: null, down: false };
/** An object, and the reason why it is or is not the CIPV. @typedef {{item: FusedObject, why: string}} Row */
/** @type {WeakMap<HTMLElement, {cells: Record<string, HTMLElement>, reason: HTMLElement}>} */
const parts = new WeakMap();
const body = $("#objects tbody"),
  list = new LongList(body, (/** @type {Row} */ { item }) => item.id, create, fill),
  keepTabStop = oneTabStop(body, "tr", (row) => set("selection", Number(row.dataset.id)));

export function setUp() {
  const last = el(
    "th",
    { scope: "col", class: "left reason" },
    el("button", { type: "button", textContent: "Reason", disabled: true }),
  );
  $("#objects thead").append(el("tr", {}, ...COLUMNS.map(heading), last));
  paintAfter(["frame", "selection"], update);
  on(["selection"], () => list.rowOf(get("selection") ?? -1)?.scrollIntoView({ block: "nearest" }));
  body.addEventListener("click", (event) => pick(within(event, "tr")));
  body.addEventListener("keydown", (event) => event.key === "Enter" && pick(within(event, "tr")));
  reflectSort();
}

/**
 * Closing speed in m/s along the line of sight, as in the banner.
 * @param {FusedObject} o
 * @returns {number | null}
 */
function closing(o) {
  if (!o.velocity_mps || !o.closest_point || !o.distance_m) return null;
  return -(o.closest_point[0] * o.velocity_mps[0] + o.closest_point[1] * o.velocity_mps[1]) / o.distance_m;
}

/** @param {FusedObject} o */
function distance(o) {
  if (o.distance_m === null) return DASH;
  return o.distance_sigma_m === null ? num(o.distance_m) : `${num(o.distance_m)} ± ${num(o.distance_sigma_m)}`;
}

/** @param {FusedObject} o */
function inPath(o) {
  const share = o.in_path_probability === null ? "" : ` ${Math.round(100 * o.in_path_probability)}%`;
  return `${o.in_path ? "yes" : "no"}${share}`;
}

/** @param {Column} column */
function heading({ key, label, help }) {
  const button = el("button", { type: "button", textContent: label, title: help, onclick: () => sortBy(key) });
  return el("th", { scope: "col", class: TEXTS.has(key) ? "left" : "", data: { key } }, button);
}

/** @param {string} key */
function sortBy(key) {
  if (sort.key !== key) sort = { key, down: false };
  else sort = sort.down ? { key: null, down: false } : { key, down: true };
  reflectSort();
  list.settle();
  update();
}

function reflectSort() {
  for (const th of document.querySelectorAll("#objects th[data-key]")) {
    if (/** @type {HTMLElement} */ (th).dataset.key === sort.key)
      th.setAttribute("aria-sort", sort.down ? "descending" : "ascending");
    else th.removeAttribute("aria-sort");
  }
}

function update() {
  const frame = get("frame");
  if (!frame) return;
  const { objects, rejected, cipv } = frame.result;
  const reasons = new Map(rejected.map(({ id, reason }) => [id, reason]));
  if (cipv) reasons.set(cipv.id, cipv.reason);
  const by =
    COLUMNS.find(({ key }) => key === sort.key)?.by ?? ((/** @type {FusedObject} */ o) => relevance(o, cipv?.id));
  const order = [...objects].sort((a, b) => compare(by(a), by(b)) * (sort.down ? -1 : 1) || a.id - b.id);
  const focused = body.contains(document.activeElement)
    ? Number(/** @type {HTMLElement} */ (document.activeElement).dataset.id)
    : null;
  list.show(order.map((item) => ({ item, why: reasons.get(item.id) ?? "" })));
  if (focused !== null) list.rowOf(focused)?.focus({ preventScroll: true });
  keepTabStop(list.rowOf(get("selection") ?? -1));
  const sources = new Set(["VL", "V", "L", ...objects.map(({ source }) => source)]);
  const counts = [...sources].map((source) => `${objects.filter((o) => o.source === source).length} ${source}`);
  text($("#object-facts"), `${objects.length}: ${counts.join(" · ")}`);
}

/**
 * Sort key: CIPV, in path, seen by camera, rest; by distance within each group.
 * @param {FusedObject} item
 * @param {number|undefined} lead
 */
function relevance(item, lead) {
  const group = item.id === lead ? 0 : item.in_path ? 1 : isImaged(item) && !item.carried ? 2 : 3;
  return group * 1000 + Math.min(item.distance_m ?? 999, 999);
}

/** @param {string|number} a @param {string|number} b */
const compare = (a, b) => (a < b ? -1 : a > b ? 1 : 0);

/** @param {HTMLElement} row @param {Row} shown */
function fill(row, { item, why }) {
  const { cells, reason } = /** @type {NonNullable<ReturnType<typeof parts.get>>} */ (parts.get(row));
  row.classList.toggle("is-cipv", item.id === cipvId());
  row.classList.toggle("is-selected", item.id === get("selection"));
  row.classList.toggle("is-carried", item.carried);
  row.setAttribute("aria-selected", String(item.id === get("selection")));
  for (const { key, words } of COLUMNS) text(cells[key], words(item));
  mark(cells.source, "role", roleOf(item, null));
  cells.inPath.className = item.in_path ? "yes" : "no";
  const words = item.carried ? `carried, not detected in this frame · ${why}` : why;
  if (reason.title === words) return;
  text(reason, item.carried ? `carried · ${why}` : why);
  reason.title = words;
}

function create() {
  /** @type {Record<string, HTMLElement>} */
  const cells = {};
  const reason = el("td", { class: "reason" });
  const row = el(
    "tr",
    { tabIndex: -1 },
    ...COLUMNS.map(({ key }) => {
      if (key === "source") return el("td", { class: "left" }, (cells[key] = el("span", { class: "pill" })));
      return (cells[key] = el("td", { class: key === "id" ? "id" : TEXTS.has(key) ? "left" : "", data: { key } }));
    }),
    reason,
  );
  parts.set(row, { cells, reason });
  return row;
}

/** @param {HTMLElement|null} row */
function pick(row) {
  if (row) select(Number(row.dataset.id));
}
