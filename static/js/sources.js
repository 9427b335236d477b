/** The dialog that opens another recording. */
import { request } from "./api.js";
import { $, el, text } from "./dom.js";
import { get, on } from "./store.js";

const dialog = $("#source-dialog", HTMLDialogElement);

export function setUp() {
  $("#source-button").addEventListener("click", open);
  on(["state"], () => text($("#source-title"), get("state")?.title || get("state")?.uri || "opening …"));
}

export async function open() {
  /** @type {{sources: {uri: string, title: string}[], open: string|null}} */
  const { sources, open: current } = await request("api/sources").catch(() => ({ sources: [], open: null }));
  const field = el("input", { type: "text", name: "uri", value: current ?? "", placeholder: "pcap:<file>, rosbag:<path>, kitti:<folder>, sim:<scenario>", aria: { label: "Address of a recording" }, spellcheck: false });
  const form = el("form", { class: "open-row", method: "dialog" }, field, el("button", { textContent: "Open" }));
  form.addEventListener("submit", () => choose(field.value));
  const list = sources.map(({ uri, title }) => {
    const button = el("button", { type: "button", onclick: () => choose(uri) }, el("span", { textContent: title }), el("code", { textContent: uri }));
    if (uri === current) button.setAttribute("aria-current", "true");
    return button;
  });
  dialog.replaceChildren(el("h2", { textContent: "Open a recording" }), form, el("div", { class: "open-list" }, ...list));
  dialog.showModal();
  field.select();
}

/** @param {string} uri */
function choose(uri) {
  dialog.close();
  if (uri.trim()) request("api/source", "POST", { uri }).catch(() => {});
}
