/** The table of the Fleet view. */
import { $, el } from "../core/dom.js";
import { oneTabStop } from "../keys/one_tab_stop.js";

/** Titles of columns whose names are not clear. @type {Record<string, string>} */
const TITLES = { t_s: "time (s)", index: "frame" };
/** Suffixes of column names, and their units. @type {[string, string][]} */
const UNITS = [
  ["_mps", "m/s"],
  ["_sigmas", "σ"],
  ["_s", "s"],
  ["_m", "m"],
];
/** Not shown, since the drive's name contains it. */
const HIDDEN = new Set(["address"]);
/** Of the table, which is built anew whenever the view opens. @type {{body: HTMLElement, keep: () => void}|null} */
let tabStop = null;
const LEFT = new Set(["drive", "kind", "text", "title", "source", "type"]);

/**
 * @param {{columns: string[], rows: any[][]}} found
 * @param {(row: Record<string, any>) => void} onOpen @param {(column: string) => void} onSort
 * @param {{order: string, descending: boolean}} sorted
 */
export function showRows(found, onOpen, onSort, sorted) {
  const shown = found.columns.filter((name) => !HIDDEN.has(name));
  const heads = shown.map((name) => {
    const [ending, unit] = UNITS.find(([each]) => name.endsWith(each)) ?? ["", ""];
    const plain = name.slice(0, name.length - ending.length).replaceAll("_", " ");
    const words = TITLES[name] ?? (unit ? `${plain} (${unit})` : plain);
    const button = el("button", { type: "button", textContent: words, title: "Sort", onclick: () => onSort(name) });
    const head = el("th", { class: LEFT.has(name) ? "left" : "", scope: "col" }, button);
    if (name === sorted.order) head.ariaSort = sorted.descending ? "descending" : "ascending";
    return head;
  });
  $("#fleet-rows thead").replaceChildren(el("tr", {}, ...heads));
  const rows = found.rows.map((values) => {
    const row = Object.fromEntries(found.columns.map((name, place) => [name, values[place]]));
    const cells = shown.map((name) => {
      const words = cell(name, row[name]);
      if (!LEFT.has(name)) return el("td", { textContent: words });
      return el("td", { class: "left", textContent: words, title: `${words}\n${row.address}` });
    });
    const line = el("tr", { tabIndex: -1, title: `Open ${row.address}` }, ...cells);
    line.addEventListener("click", () => onOpen(row));
    line.addEventListener("keydown", (event) => {
      if (event.key === "Enter") onOpen(row);
    });
    return line;
  });
  const nothing = el("td", { class: "left facts", colSpan: shown.length, textContent: "Nothing meets these filters." });
  const body = $("#fleet-rows tbody");
  body.replaceChildren(...(rows.length ? rows : [el("tr", { class: "fleet-none" }, nothing)]));
  if (tabStop?.body !== body) tabStop = { body, keep: oneTabStop(body, "tr:not(.fleet-none)") };
  tabStop.keep();
}

/** No rows, while they are unknown. */
export function clearRows() {
  $("#fleet-rows thead").replaceChildren();
  $("#fleet-rows tbody").replaceChildren();
}

/** @param {string} name @param {any} value */
function cell(name, value) {
  if (value === null) return "–";
  if (typeof value === "boolean") return value ? "yes" : "no";
  return typeof value === "number" && UNITS.some(([each]) => name.endsWith(each)) ? value.toFixed(2) : String(value);
}
