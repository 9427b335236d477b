/** The export menu for the clip or the whole drive, with background jobs and their progress. */
import { request } from "../core/api.js";
import { $, el, text } from "../core/dom.js";
import { attachMenu, refill } from "../workspace/menu.js";
import { chosen } from "./clip.js";

/** @typedef {import("../drive/types.js").Job} Job */

const KINDS = [
  ["mcap", "MCAP", "sensor data and results"],
  ["rrd", "rerun .rrd", "for the rerun viewer"],
  ["mp4", "MP4", "camera with overlay"],
  ["csv", "CSV", "one row per frame"],
  ["html", "HTML report", "single page"],
  ["ply", "PLY", "LiDAR points, up to 300 frames"],
];
const POLL_MS = 300;

const button = $("#export-button");
/** @type {Job[]} newest first */
let jobs = [];
let problem = "";
let timer = 0;

export function setUp() {
  attachMenu(button, "Export", () => {
    look();
    return fill();
  });
}

function fill() {
  const { first, last } = chosen();
  const kinds = KINDS.map(([kind, label, words]) =>
    el(
      "button",
      { type: "button", class: "item", onclick: () => begin(kind) },
      el("b", { textContent: label }),
      el("span", { class: "facts", textContent: ` ${words}` }),
    ),
  );
  const complaint = problem ? [el("p", { class: "params-error", textContent: problem })] : [];
  return [
    el("h3", { textContent: `Export frames ${first + 1} to ${last + 1}` }),
    ...kinds,
    ...complaint,
    ...(jobs.length ? [el("h3", { textContent: "Files" })] : []),
    ...jobs.map(row),
  ];
}

/** @param {string} kind */
async function begin(kind) {
  problem = "";
  await request("api/clip", "POST", { ...chosen(), kind }).catch((error) => (problem = error.message));
  look();
}

/** Poll the jobs while any is active. */
async function look() {
  clearTimeout(timer);
  const answer = await request("api/jobs").catch(() => ({ jobs }));
  jobs = [...answer.jobs].reverse();
  refill(button, fill);
  const active = jobs.some(({ state }) => state === "waiting" || state === "running");
  text(button, active ? "Exporting …" : "Export ▾");
  if (active) timer = setTimeout(look, POLL_MS);
}

/** @param {Job} job */
function row(job) {
  const words = job.file ?? `${job.kind} ${job.first + 1}–${job.last + 1}`;
  const drop = el("button", {
    type: "button",
    class: "drop",
    textContent: "✕",
    aria: { label: `Remove ${words}` },
    onclick: () => request(`api/jobs/${job.id}`, "DELETE").then(look, look),
  });
  return el("div", { class: "menu-row job" }, job.state === "done" ? download(job, words) : progress(job, words), drop);
}

/** @param {Job} job @param {string} words */
function download(job, words) {
  const link = el("a", { href: `api/jobs/${job.id}/file`, textContent: words });
  link.setAttribute("download", job.file ?? "");
  return el(
    "span",
    { class: "grow-1" },
    link,
    el("span", { class: "facts", textContent: job.bytes === null ? "" : ` ${size(job.bytes)}` }),
  );
}

/** @param {Job} job @param {string} words */
function progress(job, words) {
  const isOver = job.state === "failed" || job.state === "cancelled";
  const state = isOver ? `${job.state}${job.note ? `: ${job.note}` : ""}` : job.note;
  const bar = el("progress", { max: 1, value: job.progress, aria: { label: words } });
  return el(
    "span",
    { class: "grow-1" },
    words,
    el("span", { class: isOver ? "params-error" : "facts", textContent: ` ${state}` }),
    isOver ? null : bar,
  );
}

/** @param {number} bytes */
const size = (bytes) => (bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
