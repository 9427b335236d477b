/** Keeps the drive's columns, events and comparison in sync with the server. */
import { newestOnly, request } from "../core/api.js";
import { get, on, set } from "../core/store.js";

/** @typedef {import("./types.js").Series} Series */
/** @typedef {import("./types.js").Drive} Drive */
/** @typedef {Pick<Drive, "events"|"comparison">} Findings */

/** Minimum interval between fetches during a run: of columns, and of events and comparison. */
const PAUSE_MS = 200,
  FINDINGS_PAUSE_MS = 1000;

let known = "";
/** @type {Record<number, Series>} the current and the compared run, by number */
let held = {};
let foundAt_ms = -Infinity;

const refresh = newestOnly(async (/** @type {string} */ key) => {
  await fetchAll().catch(() => key === known && (known = ""));
  if (get("state")?.drive.running) await new Promise((done) => setTimeout(done, PAUSE_MS));
});

export function setUp() {
  on(["state"], follow);
}

function follow() {
  const state = get("state");
  if (!state || state.live || state.drive.run === null) return;
  const { revision, run, base } = state.drive,
    key = `${state.uri} ${revision} ${run} ${base} ${base === null ? "" : state.labels?.revision}`;
  if (key === known) return;
  known = key;
  refresh(key);
}

async function fetchAll() {
  const state = get("state");
  if (!state || state.drive.run === null) return;
  const { run, base } = state.drive;
  const before = get("drive")?.uri === state.uri ? get("drive") : null;
  if (!before) held = {};
  const [now, { t_s, clips }] = await fetchSeries(run, "api/drive");
  const [old] = base === null || base === run ? [null] : await fetchSeries(base, `api/runs/${base}/columns`);
  held = Object.fromEntries([now, old].filter((series) => series !== null).map((series) => [series.run, series]));
  const found = await findings(before, now, old);
  if (get("state")?.uri !== state.uri) return;
  set("drive", {
    uri: state.uri,
    count: state.count,
    t_s: t_s.length ? t_s : (before?.t_s ?? []),
    clips: t_s.length ? clips : (before?.clips ?? []),
    now,
    base: old,
    ...found,
  });
}

/**
 * Extend a run's known columns by what the server has since computed.
 * @param {number} run
 * @param {string} path
 * @returns {Promise<[Series, {t_s: number[], clips: number[]}]>} the series, and the times and clips of the recording
 *   if they were sent
 */
async function fetchSeries(run, path) {
  const from = held[run]?.done ?? 0;
  const answer = /** @type {import("./types.js").ColumnsAnswer} */ (await request(`${path}?from=${from}`));
  const isMore = answer.run === run && from > 0;
  return [
    isMore ? extended(held[run], answer) : { run: answer.run, done: answer.done, columns: answer.columns },
    answer,
  ];
}

/** @param {Series} series @param {import("./types.js").ColumnsAnswer} more @returns {Series} */
function extended({ run, columns }, more) {
  const joined = Object.entries(more.columns).map(([name, values]) => [
    name,
    [...columns[/** @type {keyof typeof columns} */ (name)].slice(0, more.from), ...values],
  ]);
  return { run, done: more.done, columns: Object.fromEntries(joined) };
}

/**
 * Fetch the events, and the comparison of the two runs.
 * @param {Drive|null} before
 * @param {Series} now
 * @param {Series|null} base
 * @returns {Promise<Findings>}
 */
async function findings(before, now, base) {
  const isSame = before?.now?.run === now.run && before.base?.run === base?.run;
  if (isSame && get("state")?.drive.running && performance.now() - foundAt_ms < FINDINGS_PAUSE_MS) return before;
  foundAt_ms = performance.now();
  const [{ events }, compared] = await Promise.all([
    request("api/drive/events"),
    base ? request("api/compare").catch(() => null) : null, // a run may have been deleted meanwhile
  ]);
  return { events, comparison: compared?.base === base?.run && compared?.run === now.run ? compared : null };
}
