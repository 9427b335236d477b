/**
 * Label files: export (with what each format loses), import, ground truth of the recording, and versions.
 */
import { Refused, request } from "../../core/api.js";
import { $, el, press, text } from "../../core/dom.js";
import { get } from "../../core/store.js";
import { attachMenu, refill } from "../../workspace/menu.js";
import { act } from "../acts/queue.js";
import { propose, say } from "../acts/commands.js";
import { personName } from "../state/person.js";
import * as second from "./second_labeler.js";
import * as queue from "../queue/queue_list.js";

/** @typedef {import("../state/types.js").Version} Version */

/** @typedef {{name: string, title: string, about: string}} Format One entry of `/api/labels/formats`. */

/** @type {Format[]} Empty until the server has listed them. */
let formats = [];

const versions = el("div", { class: "open-list" }),
  problem = el("p", { class: "params-error", aria: { role: "alert" } });
const which = el("select", { aria: { label: "File format" } });
const file = el("input", { type: "file", aria: { label: "Label file" } });
const freezeName = el("input", {
  type: "text",
  maxLength: 60,
  placeholder: "Version name",
  required: true,
  aria: { label: "Version name" },
});

/** @returns {HTMLElement} */
export function exportButton() {
  const button = el("button", {
    type: "button",
    textContent: "Export ▾",
    aria: { haspopup: "menu" },
    title: "Export labels to a file",
  });
  const rows = () => exportRows(() => refill(button, rows));
  attachMenu(button, "Export labels", rows);
  return button;
}

const ONLY = /** @type {const} */ ([
  ["all", "All", "All labels, with their state if the format has a field for it"],
  ["accepted", "Accepted", "Labels that somebody accepted or corrected"],
  ["reviewed", "Reviewed", "Labels that a second person approved"],
]);
/** Which labels are exported. @type {"all"|"accepted"|"reviewed"} */
let only = "all";

/** Which labels, and one download link for each format. @param {() => void} again draws the rows anew */
function exportRows(again) {
  const choices = ONLY.map(([key, words, title]) => {
    const choice = el("button", {
      type: "button",
      textContent: words,
      title,
      onclick: () => {
        only = key;
        again();
      },
    });
    press(choice, only === key);
    return choice;
  });
  const which = el("div", { class: "list-bar" }, el("div", { class: "joined" }, ...choices));
  const entries = el("div", {}, el("p", { class: "facts pad", textContent: "Checking what each format loses …" }));
  fillEntries(entries);
  return [el("h3", { textContent: "Export labels" }), which, entries];
}

/** Fill in all entries at once: one that came later would move the others under the pointer.
 * @param {HTMLElement} entries */
async function fillEntries(entries) {
  if (!formats.length) await listFormats();
  if (!formats.length) {
    const words = "No answer from the server. Open this menu again.";
    return entries.replaceChildren(el("p", { class: "facts pad", textContent: words }));
  }
  const asked = Promise.all(formats.map(({ name }) => lossesOf(name)));
  const [problems, losses] = await Promise.all([countProblems(), asked]);
  const words = `⚠ ${problems} to check first`;
  const suspicious = el("button", { type: "button", class: "quiet", textContent: words, onclick: goToChecks });
  const links = formats.flatMap((format, k) => linkTo(format, losses[k]));
  entries.replaceChildren(...(problems ? [suspicious] : []), ...links);
}

/** The download link of a format, and what it loses. @param {Format} format @param {string[]} lost */
function linkTo({ name, title, about }, lost) {
  const link = el(
    "a",
    { class: "item", href: `api/labels/export?format=${name}&version=working&only=${only}`, title: lost.join("\n") },
    el("b", { textContent: title }),
    el("span", { class: "facts", textContent: about }),
  );
  link.setAttribute("download", "");
  if (!lost.length) return [link];
  link.append(el("span", { class: "loses", textContent: `loses ${lost.length}` }));
  return [link, el("ul", { class: "losses facts" }, ...lost.map((words) => el("li", { textContent: words })))];
}

const goToChecks = () => $("#tab-label-checks").click();

/** How many problems the checks have found: said before anything is exported. @returns {Promise<number>} */
async function countProblems() {
  /** @type {{problems: unknown[]}|null} */
  const found = await request("api/labels/checks").catch(() => null);
  return found?.problems.length ?? 0;
}

/** Ask the server which formats it reads and writes; without an answer the next look asks again. */
async function listFormats() {
  formats = await request("api/labels/formats").catch(() => []);
  which.replaceChildren(...formats.map(({ name, title }) => el("option", { value: name, textContent: title })));
}

/** What a format cannot hold. @param {string} key @returns {Promise<string[]>} */
async function lossesOf(key) {
  /** @type {{lost: string[]}} */
  const { lost } = await request(`api/labels/export/notes?format=${key}&only=${only}`).catch((error) => ({
    lost: [error.message],
  }));
  return lost;
}

/** @param {HTMLElement} parent */
export function setUp(parent) {
  parent.append(
    problem,
    el("h3", { textContent: "Proposals" }),
    el("button", { type: "button", textContent: "Propose labels from the pipeline (P)", onclick: propose }),
    el("h3", { textContent: "Import" }),
    el("button", {
      type: "button",
      textContent: "Ground truth of the recording",
      onclick: () => act({ kind: "import", what: "truth" }),
    }),
    el("form", { onsubmit: upload }, which, file, el("button", { textContent: "Import file" })),
    el("h3", { textContent: "Versions" }),
    versions,
    el("form", { class: "menu-row", onsubmit: freeze }, freezeName, el("button", { textContent: "Freeze" })),
  );
  second.setUp(parent);
  second.onFrozen(look);
  queue.setUp(parent);
}

/** Reload the versions and the queue. */
export async function look() {
  queue.look();
  if (!formats.length) listFormats();
  /** @type {Version[]} */
  const found = await request("api/labels/versions").catch(() => []);
  second.show(found);
  versions.replaceChildren(
    ...found.map(({ name, person, t_unix_ms, tracks, frames }) => {
      const link = el("a", { href: `api/labels/versions/${encodeURIComponent(name)}`, textContent: name });
      link.setAttribute("download", `${name}.json`);
      return el(
        "p",
        {},
        link,
        el("span", {
          class: "facts",
          textContent: ` ${tracks} tracks in ${frames} frames · ${person}, ${dateWords(t_unix_ms)}`,
        }),
      );
    }),
  );
  if (!found.length)
    versions.replaceChildren(
      el("p", { class: "facts", textContent: "No versions yet. A version is a named snapshot of the labels." }),
    );
}

/** Date and time of day. @param {number} t_unix_ms */
const dateWords = (t_unix_ms) => new Date(t_unix_ms).toLocaleString("en-GB");

/** @param {Event} event */
async function freeze(event) {
  event.preventDefault();
  const person = await personName();
  if (person === null) return;
  const isDone = await attempt(() => request("api/labels/versions", "POST", { name: freezeName.value.trim(), person }));
  if (isDone) freezeName.value = "";
  look();
}

/** @param {Event} event */
async function upload(event) {
  event.preventDefault();
  const given = file.files?.[0],
    person = await personName(),
    drive = get("labels")?.drive;
  if (!given || person === null || !drive) return;
  if (!formats.length) await listFormats();
  await attempt(async () => {
    const query = new URLSearchParams({ format: which.value, person, drive });
    const address = new URL(`api/labels/import?${query}`, document.baseURI);
    const response = await fetch(address, {
      method: "POST",
      body: given,
      headers: { "content-type": "application/octet-stream" },
    });
    if (!response.ok) throw new Refused(response.status, await response.json().catch(() => null));
    say(`Importing ${given.name}`);
  });
}

/** @param {() => Promise<unknown>} what @returns {Promise<boolean>} whether it succeeded */
async function attempt(what) {
  text(problem, "");
  return what().then(
    () => true,
    (error) => {
      text(problem, error.message);
      return false;
    },
  );
}
