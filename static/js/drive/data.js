/** The whole recording as far as the server has computed it. What is new is fetched when the state says so. */
import { newestOnly, request } from "../api.js";
import { get, on, set } from "../store.js";

/** @typedef {import("../types.js").DriveState} DriveState */
/** @typedef {import("../types.js").Series} Series */
/** @typedef {import("../types.js").Drive} Drive */

/** While a run is under way it is looked at no more often. */
const PAUSE_MS = 200;

let known = "";
/** @type {Record<number, Series>} series of the runs shown, by run */
let held = {};

const refresh = newestOnly(async (/** @type {string} */ key) => {
  await fetchAll().catch(() => (known = ""));
  if (get("state")?.drive?.running) await new Promise((done) => setTimeout(done, PAUSE_MS));
  return void key;
});

export function setUp() {
  on(["state"], follow);
}

function follow() {
  const state = get("state");
  const key = `${state?.uri} ${state?.drive?.revision} ${state?.drive?.run} ${state?.drive?.base}`;
  if (key === known || !state?.drive) return;
  known = key;
  refresh(key);
}

async function fetchAll() {
  const state = get("state");
  if (!state?.drive || state.drive.run === null) return;
  const { run, base } = state.drive;
  const before = get("drive");
  const isSame = before?.uri === state.uri;
  if (!isSame) held = {};
  const [now, t_s] = await fetchSeries(run, "api/drive");
  const [old] = base === null || base === run ? [null] : await fetchSeries(base, `api/runs/${base}/columns`);
  held = Object.fromEntries([now, old].filter((series) => series !== null).map((series) => [series.run, series]));
  const [{ events }, comparison] = await Promise.all([
    request("api/drive/events"), old ? request(`api/compare?base=${old.run}&run=${now.run}`).catch(() => null) : null,
  ]);
  if (get("state")?.uri !== state.uri) return;
  set("drive", { uri: state.uri, count: state.count, t_s: t_s.length ? t_s : before?.t_s ?? [], now, base: old, events, comparison });
}

/**
 * What is held of a run, and what the server has beyond it.
 * @param {number} run @param {string} path @returns {Promise<[Series, number[]]>} the series, and the frames' times where they came
 */
async function fetchSeries(run, path) {
  const from = held[run]?.done ?? 0;
  const answer = /** @type {import("../types.js").ColumnsAnswer} */ (await request(`${path}?from=${from}`));
  const isMore = answer.run === run && from > 0;
  return [isMore ? extended(held[run], answer) : { run: answer.run, done: answer.done, columns: answer.columns }, answer.t_s];
}

/** @param {Series} series @param {import("../types.js").ColumnsAnswer} more @returns {Series} */
function extended({ run, columns }, more) {
  const joined = Object.entries(more.columns).map(([name, values]) => [name, [...columns[/** @type {keyof typeof columns} */ (name)].slice(0, more.from), ...values]]);
  return { run, done: more.done, columns: Object.fromEntries(joined) };
}
