/** The dialog for opening another recording. */
import { request } from "../core/api.js";
import { $, el, entitle, memory, text } from "../core/dom.js";
import { refused } from "./notices.js";
import { get, on } from "../core/store.js";

/** @typedef {{uri: string, title: string}} Offered */

/** How many recordings are remembered. */
const MOST_OPENED = 8;

const dialog = $("#source-dialog", HTMLDialogElement);
/** The last URI that could not be opened, so that a typo can be corrected. @type {string|null} */
let wanted = null;
/** @type {string|null|undefined} */
let openUri;

export function setUp() {
  $("#source-button").addEventListener("click", open);
  on(["state"], () => {
    const state = get("state");
    if (state?.uri !== openUri) {
      wanted = null;
      if (state?.uri) remember({ uri: state.uri, title: state.title || state.uri });
    }
    openUri = state?.uri;
    text($("#source-title"), state?.title || state?.uri || "opening …");
    entitle($("#source-title"), `${state?.title ?? ""} (${state?.uri ?? ""}): open another recording (F)`);
  });
}

/** An address without the name of its kind, which the command line need not be given. @param {string} uri */
const place = (uri) => uri.replace(/^\w+:(?=\/)/, "");

/** Those opened in this browser, newest first. @returns {Offered[]} */
const opened = () => memory.read("opened", []);

/** @param {Offered} recording */
function remember(recording) {
  const others = opened().filter(({ uri }) => uri !== recording.uri);
  memory.write("opened", [recording, ...others].slice(0, MOST_OPENED));
}

/** Shown at once: on a busy server, the list may take seconds. */
export async function open() {
  const current = get("state")?.uri ?? null,
    offers = el("div", {}, el("p", { class: "facts", textContent: "Loading the list …" }));
  const field = el("input", {
    type: "text",
    name: "uri",
    value: wanted ?? current ?? "",
    placeholder: "pcap:<file>, rosbag:<path>, kitti:<folder>, sim:<scenario>",
    aria: { label: "Recording URI" },
    spellcheck: false,
  });
  const form = el("form", { class: "open-row", method: "dialog" }, field, el("button", { textContent: "Open" }));
  form.addEventListener("submit", () => choose(field.value));
  dialog.replaceChildren(el("h2", { textContent: "Open a recording" }), form, offers);
  if (!dialog.open) dialog.showModal();
  field.select();
  /** @type {{sources: Offered[]}|Error} */
  const answer = await request("api/sources").catch((problem) => problem);
  if (answer instanceof Error)
    return offers.replaceChildren(el("p", { class: "facts", textContent: `No list: ${answer.message}` }));
  const isSimulated = (/** @type {Offered} */ { uri }) => uri.startsWith("sim:");
  const known = new Set([current ?? "", ...answer.sources.map(({ uri }) => uri)].map(place));
  offers.replaceChildren(
    ...list("Opened before", opened().filter(({ uri }) => !known.has(place(uri))), current),
    ...list("Recordings", answer.sources.filter((each) => !isSimulated(each)), current),
    ...list("Simulations", answer.sources.filter(isSimulated), current),
  );
}

/** @param {string} heading @param {Offered[]} offered @param {string|null} current @returns {HTMLElement[]} */
function list(heading, offered, current) {
  if (!offered.length) return [];
  const buttons = offered.map(({ uri, title }) => {
    const button = el(
      "button",
      { type: "button", onclick: () => choose(uri) },
      el("span", { textContent: title }),
      el("code", { textContent: uri, title: uri }),
    );
    if (place(uri) === place(current ?? "")) button.setAttribute("aria-current", "true");
    return button;
  });
  return [el("h3", { textContent: heading }), el("div", { class: "open-list" }, ...buttons)];
}

/** @param {string} uri */
function choose(uri) {
  dialog.close();
  wanted = uri.trim() || null;
  if (uri.trim()) request("api/source", "POST", { uri }).catch(refused);
}
