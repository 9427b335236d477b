/** The table of fused objects: one row each, sorted, with the reason why it is the CIPV or why not. */
import { cipvId } from "./colors.js";
import { $, el, text } from "./dom.js";
import { DASH, kmh, num, side, signed } from "./format.js";
import { get, on, paint, select, set } from "./store.js";

/** @typedef {import("./types.js").FusedObject} FusedObject */

/** key, heading, help, text of a cell, what it is sorted by. */
const COLUMNS = [
  ["id", "#", "Number of the object; it keeps it while it is tracked", (o) => `#${o.id}`, (o) => o.id],
  ["source", "Seen", "V camera, L LiDAR, VL both", (o) => o.source, (o) => o.source],
  ["type", "Class", "What the detector calls it, and its score", (o) => (o.type ? `${o.type} ${num(o.type_score, 2)}` : DASH), (o) => o.type ?? "~"],
  ["distance", "Distance", "To its nearest point, with one sigma, metres", distance, (o) => o.distance_m ?? Infinity],
  ["velocity", "Closing", "Closing speed, km/h: positive while the gap shrinks", (o) => (closing(o) === null ? DASH : signed(kmh(closing(o)))), (o) => -(closing(o) ?? -Infinity)],
  ["ttc", "TTC", "Time to collision, seconds; a dash when the gap does not shrink", (o) => num(o.ttc_s), (o) => o.ttc_s ?? Infinity],
  ["offset", "Offset", "From the middle of the path, metres to the left or right", (o) => side(o.path_offset_m), (o) => Math.abs(o.path_offset_m ?? Infinity)],
  ["inPath", "In path", "Inside our corridor, and how probable that is", inPath, (o) => -(o.in_path_probability ?? Number(o.in_path))],
  ["hits", "Hits", "Sightings so far", (o) => String(o.hits), (o) => -o.hits],
  ["points", "Points", "LiDAR points on it", (o) => (o.lidar_points ? String(o.lidar_points) : DASH), (o) => -o.lidar_points],
  ["reason", "Why, or why not", "", null, null],
];

/** Null key: what matters first. */
let sort = { key: null, down: false };
/** @type {Map<number, {row: HTMLTableRowElement, cells: Record<string, HTMLElement>}>} */
const rows = new Map();
const body = $("#objects tbody");

export function setUp() {
  $("#objects thead").append(el("tr", {}, ...COLUMNS.map(heading)));
  paint(["frame", "selection"], update);
  on(["selection"], () => rows.get(get("selection"))?.row.scrollIntoView({ block: "nearest" }));
  body.addEventListener("click", (event) => pick(event.target.closest("tr")));
  body.addEventListener("keydown", onKey);
  reflectSort();
}

/** m/s towards us along the line to its nearest point, as the banner shows it. @param {FusedObject} o @returns {number | null} */
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
  const share = o.in_path_probability === null ? "" : ` ${Math.round(100 * o.in_path_probability)} %`;
  return `${o.in_path ? "yes" : "no"}${share}`;
}

function heading([key, label, help, , by]) {
  const isText = ["id", "source", "type", "reason"].includes(key);
  if (!by) return el("th", { scope: "col", class: "left" }, el("button", { type: "button", textContent: label, disabled: true }));
  const button = el("button", { type: "button", textContent: label, title: help, onclick: () => sortBy(key) });
  return el("th", { scope: "col", class: isText ? "left" : "", data: { key } }, button);
}

function sortBy(key) {
  if (sort.key !== key) sort = { key, down: false };
  else sort = sort.down ? { key: null, down: false } : { key, down: true };
  reflectSort();
  update();
}

function reflectSort() {
  for (const th of document.querySelectorAll("#objects th[data-key]")) {
    if (th.dataset.key === sort.key) th.setAttribute("aria-sort", sort.down ? "descending" : "ascending");
    else th.removeAttribute("aria-sort");
  }
}

function update() {
  const frame = get("frame");
  if (!frame) return;
  const { objects, rejected, cipv } = frame.result;
  const reasons = new Map(rejected.map(({ id, reason }) => [id, reason]));
  if (cipv) reasons.set(cipv.id, cipv.reason);
  const by = COLUMNS.find(([key]) => key === sort.key)?.[4] ?? ((o) => relevance(o, cipv?.id));
  const order = [...objects].sort((a, b) => compare(by(a), by(b)) * (sort.down ? -1 : 1) || a.id - b.id);
  const present = new Set(objects.map(({ id }) => id));
  for (const [id, { row }] of rows) {
    if (present.has(id)) continue;
    row.remove();
    rows.delete(id);
  }
  order.forEach((item, place) => {
    const { row } = fill(item, reasons.get(item.id) ?? "");
    if (body.children[place] !== row) body.insertBefore(row, body.children[place] ?? null);
  });
  const count = (source) => objects.filter((o) => o.source === source).length;
  text($("#object-facts"), `${objects.length}: ${count("VL")} VL · ${count("V")} V · ${count("L")} L`);
}

/** The CIPV, then what is in the path, then what a camera sees, then the rest; nearer first among equals. */
function relevance(item, lead) {
  const group = item.id === lead ? 0 : item.in_path ? 1 : item.source !== "L" && !item.carried ? 2 : 3;
  return group * 1000 + Math.min(item.distance_m ?? 999, 999);
}

const compare = (a, b) => (a < b ? -1 : a > b ? 1 : 0);

/** @param {FusedObject} item @param {string} reason */
function fill(item, reason) {
  const held = rows.get(item.id) ?? create(item.id);
  const { row, cells } = held;
  row.classList.toggle("is-cipv", item.id === cipvId());
  row.classList.toggle("is-selected", item.id === get("selection"));
  row.classList.toggle("is-carried", item.carried);
  row.setAttribute("aria-selected", String(item.id === get("selection")));
  for (const [key, , , words] of COLUMNS) if (words) text(cells[key], words(item));
  cells.source.dataset.source = item.source;
  cells.inPath.className = item.in_path ? "yes" : "no";
  text(cells.reason, item.carried ? `carried, not seen in this frame · ${reason}` : reason);
  cells.reason.title = cells.reason.textContent;
  return held;
}

function create(id) {
  const cells = {};
  const row = el("tr", { tabIndex: 0, data: { id } }, ...COLUMNS.map(([key]) => {
    if (key === "source") return el("td", { class: "left" }, (cells[key] = el("span", { class: "pill" })));
    const isLeft = key === "type";
    const kind = key === "reason" ? "reason" : key === "id" ? "id" : isLeft ? "left" : "";
    return (cells[key] = el("td", { class: kind, data: { key } }));
  }));
  const held = { row, cells };
  rows.set(id, held);
  return held;
}

function pick(row) {
  if (row) select(Number(row.dataset.id));
}

function onKey(event) {
  const row = event.target.closest("tr");
  if (!row) return;
  if (event.key === "Enter") pick(row);
  const next = { ArrowDown: row.nextElementSibling, ArrowUp: row.previousElementSibling }[event.key];
  if (next) {
    next.focus();
    set("selection", Number(next.dataset.id));
    event.preventDefault();
  }
}
