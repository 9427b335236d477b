/**
 * The Fleet view: events, frames, objects or drives of a whole fleet, filtered and counted. Clicking a row opens that
 * moment in the dashboard. Filters stay while the page is open.
 */
import { newestOnly, request } from "../core/api.js";
import { $, el, memory } from "../core/dom.js";
import { refused } from "../panels/notices.js";
import { goTo } from "../workspace/share_link.js";
import { histogram, showKinds } from "./charts.js";
import { CHARTS, condition, filters, setRange, toggleKind, toggleNamed, toggleTable } from "./filters.js";
import { clearRows, showRows } from "./rows.js";

/**
 * @typedef {object} Fleet
 * @property {string|null} address
 * @property {string[]} runs
 * @property {Record<string, string>} about what distinguishes each run
 * @property {string[]} kinds
 * @property {Record<string, string>} named
 */

/** @typedef {{address: string, index: number}} Moment */

/** The rows, in the browser's history. */
const ROWS = "rows";
const TABLES = /** @type {const} */ (["events", "frames", "objects", "drives"]);
const dialog = $("#fleet-dialog", HTMLDialogElement);
/** @type {Fleet|null} */
let fleet = null;
/** Those of the chosen table. @type {import("./charts.js").Histogram[]} */
let charts = [];

export function setUp() {
  $("#fleet-button").addEventListener("click", open);
  addEventListener("popstate", ({ state }) => followHistory(state?.fleet));
}

async function open() {
  try {
    fleet = await request("api/fleet");
  } catch (error) {
    return void refused(/** @type {Error} */ (error));
  }
  if (!fleet?.address) return showHint();
  if (!filters.run || !fleet.runs.includes(filters.run)) filters.run = fleet.runs[0];
  build();
  buildCharts();
  dialog.showModal();
  $("#fleet-where").focus();
  await load();
}

function showHint() {
  dialog.classList.remove("is-full");
  dialog.replaceChildren(
    el("h2", { textContent: "No fleet is open" }),
    el(
      "p",
      {},
      "Start the dashboard with the folder of a batch: ",
      el("code", { textContent: "cipv serve SOURCE --fleet DIR" }),
    ),
    el("form", { class: "dialog-buttons", method: "dialog" }, el("button", { textContent: "Close" })),
  );
  dialog.showModal();
}

/** The dialog's parts; `load` fills them. */
function build() {
  const known = /** @type {Fleet} */ (fleet);
  dialog.classList.add("is-full");
  const tabs = TABLES.map((name) => {
    const button = el("button", { type: "button", textContent: name, data: { of: name }, aria: { role: "tab" } });
    button.addEventListener("click", () => changed(() => chooseTable(name)));
    return button;
  });
  const runs = el(
    "select",
    { class: "fleet-runs", aria: { label: "Run" } },
    ...known.runs.map((name, place) => {
      const words = `${name}${place ? "" : " (last)"} · ${known.about[name]}`;
      return el("option", { value: name, textContent: words });
    }),
  );
  runs.value = filters.run;
  const describe = () => (runs.title = `Run ${filters.run}: ${known.about[filters.run]}`);
  describe();
  runs.addEventListener("change", () => {
    changed(() => (filters.run = runs.value));
    describe();
  });
  const typed = el("input", {
    type: "search",
    id: "fleet-where",
    value: filters.where,
    placeholder: "SQL condition, such as min_ttc_s < 1.5 and speed_mps > 20",
    spellcheck: false,
    aria: { label: "Condition" },
  });
  typed.addEventListener("change", () => changed(() => (filters.where = typed.value)));
  dialog.replaceChildren(
    el(
      "div",
      { class: "fleet-bar" },
      el("h2", { textContent: "Fleet" }),
      el("code", { class: "facts", textContent: known.address ?? "" }),
      runs,
      el("div", { class: "tabs", aria: { role: "tablist", label: "Table" } }, ...tabs),
      el("span", { class: "spacer" }),
      el("span", { id: "fleet-facts", class: "facts", aria: { role: "status" } }),
      el("button", { type: "button", textContent: "Clear filters", onclick: clear }),
      el("form", { method: "dialog" }, el("button", { textContent: "Close" })),
    ),
    el("div", { class: "fleet-bar" }, typed),
    el("p", { id: "fleet-problem", class: "fleet-problem", hidden: true, aria: { role: "alert" } }),
    el("div", { id: "fleet-kinds", class: "chips fleet-chips", aria: { role: "group", label: "Kinds of event" } }),
    el("div", { id: "fleet-charts", class: "fleet-charts" }),
    el(
      "div",
      { class: "fleet-rows", tabIndex: -1 },
      el("table", { id: "fleet-rows", class: "objects" }, el("thead"), el("tbody")),
    ),
  );
}

/** @param {import("./filters.js").Table} name */
function chooseTable(name) {
  if (name === filters.of) return;
  toggleTable(name);
  buildCharts();
}

function clear() {
  const field = $("#fleet-where", HTMLInputElement);
  field.value = "";
  changed(() => {
    filters.where = "";
    filters.kinds.clear();
    filters.named.clear();
    filters.ranges.clear();
  });
}

/** Change the filters and query again. @param {() => unknown} change */
function changed(change) {
  change();
  for (const { refresh } of charts) refresh();
  memory.write("fleet.of", filters.of);
  load();
}

const load = newestOnly(async (/** @type {void} */ _) => {
  const { of } = filters;
  dialog.ariaBusy = "true";
  $("#fleet-facts").textContent = "Searching…";
  for (const tab of dialog.querySelectorAll("[role=tab]"))
    tab.setAttribute("aria-selected", String(/** @type {HTMLElement} */ (tab).dataset.of === of));
  let hasRows = false;
  try {
    const found = await ask("rows", { order: filters.order, descending: String(filters.descending) });
    showRows(found, show, (column) => changed(() => sort(column)), filters);
    hasRows = true;
    const more = found.total > found.rows.length ? `, the first ${found.rows.length} shown` : "";
    $("#fleet-facts").textContent = `${found.total.toLocaleString("en")} ${of}${more}`;
    await loadCharts();
    problem("");
  } catch (error) {
    // what an earlier condition found must not look like the result of this one
    if (!hasRows) {
      $("#fleet-facts").textContent = "";
      clearRows();
    }
    clearCharts();
    problem(/** @type {Error} */ (error).message);
  }
  dialog.ariaBusy = "false";
});

async function loadCharts() {
  const { of } = filters;
  showChips(of === "events" ? await ask("counts", { column: "kind" }, { kinds: true }) : []);
  for (const [place, chart] of CHARTS[of].entries()) {
    const found = await ask("histogram", { column: chart.column }, { chart });
    if (filters.of !== of) return; // another table was chosen meanwhile: its charts are loaded next
    charts[place].fill(found);
  }
}

/** @param {{value: string|null, count: number}[]|null} counts by kind of event; null: unknown */
function showChips(counts) {
  showKinds(
    $("#fleet-kinds"),
    filters.of === "events" ? /** @type {Fleet} */ (fleet) : { kinds: [], named: {} },
    counts,
    (kind) => changed(() => toggleKind(kind)),
    (name) => changed(() => toggleNamed(name)),
    filters,
  );
}

/** No bars and no counts, while they are unknown. Chosen filters stay, to be taken back. */
function clearCharts() {
  showChips(null);
  for (const chart of charts) chart.clear();
}

/** The charts of the chosen table, still without bars. They stay until another is chosen. */
function buildCharts() {
  charts = CHARTS[filters.of].map((chart) =>
    histogram(
      chart,
      () => filters.ranges.get(chart.column) ?? [null, null],
      (range) => changed(() => setRange(chart.column, range)),
    ),
  );
  $("#fleet-charts").replaceChildren(...charts.map(({ box }) => box));
}

/**
 * @param {string} what @param {Record<string, string>} more
 * @param {Parameters<typeof condition>[0]} [without]
 */
function ask(what, more, without = {}) {
  const query = new URLSearchParams({ of: filters.of, run: filters.run, where: condition(without), ...more });
  return request(`api/fleet/${what}?${query}`);
}

/** @param {string} column */
function sort(column) {
  filters.descending = filters.order === column ? !filters.descending : false;
  filters.order = column;
}

/**
 * Open a row's moment. The browser's Back leads to the rows again, and Forward to the moment.
 * @param {Record<string, any>} row
 */
function show(row) {
  const moment = { address: row.address, index: row.index ?? 0 };
  history.replaceState({ fleet: ROWS }, "");
  history.pushState({ fleet: moment }, "");
  openMoment(moment);
}

/** @param {Moment} moment */
function openMoment({ address, index }) {
  dialog.close();
  goTo(address, index);
}

/** @param {Moment|"rows"|undefined} place undefined: not one of this view */
function followHistory(place) {
  if (place === ROWS) return void (dialog.open || open());
  if (place) openMoment(place);
}

/** @param {string} words empty: none */
function problem(words) {
  const line = $("#fleet-problem");
  line.textContent = words;
  line.hidden = !words;
}
