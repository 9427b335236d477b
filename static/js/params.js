/** The panel of parameters, made from what the server declares. Every change is sent at once, the newest only. */
import { newestOnly, request } from "./api.js";
import { $, el, memory } from "./dom.js";
import { control } from "./control.js";
import { get, on, set } from "./store.js";

const OPEN_AT_FIRST = ["alignment", "cluster"];
const FIRST_SECTION = "alignment";
/** Moving one of these means: use the model that it belongs to. */
const MODEL_OF = {
  "alignment.h_res_deg": "angular", "alignment.v_res_deg": "angular", "alignment.cx_px": "angular", "alignment.cy_px": "angular",
  "alignment.yaw_deg": "pinhole", "alignment.pitch_deg": "pinhole", "alignment.roll_deg": "pinhole",
};
const PROMINENT = new Set(["alignment.h_res_deg", "alignment.v_res_deg"]);

const panel = $("#params");
const error = el("p", { class: "params-error", aria: { role: "alert" }, hidden: true });
const list = el("div", { class: "params-list" });
const presets = el("select", { aria: { label: "Preset" }, onchange: () => choosePreset(presets.value) });
const search = el("input", { type: "search", placeholder: "Search parameters", aria: { label: "Search parameters" }, oninput: filter });
/** @type {Map<string, ReturnType<typeof control>>} */
const controls = new Map();
/** @type {Map<string, {node: HTMLDetailsElement, count: HTMLElement, help: string}>} */
const sections = new Map();
let knownRevision = -1;
let knownUri = null;

const submit = newestOnly(
  (changes) => request("api/params", "PATCH", { changes }).then(accept, refuse),
  (waiting, newer) => ({ ...waiting, ...newer }),
);

export function setUp() {
  const download = el("a", { href: "api/params.yaml", textContent: "Save YAML", title: "A file for `cipv run --params FILE`" });
  download.setAttribute("download", "cipv-params.yaml");
  panel.append(
    el("div", { class: "pane-bar" }, el("h2", { textContent: "Parameters" }), el("span", { class: "spacer" }), download),
    el("div", { class: "params-top" }, el("div", { class: "row" }, el("span", { class: "facts", textContent: "Preset" }), presets,
      el("button", { type: "button", textContent: "Reset all", title: "Back to the preset's values", onclick: () => choosePreset(presets.value) })), search, error),
    list);
  on(["state"], refreshIfForeign);
}

/** Another browser, the 3D view or another recording changed what is true: read it again. */
function refreshIfForeign() {
  const { params_revision: revision, uri, frame } = get("state");
  if (frame === null || (revision <= knownRevision && uri === knownUri)) return;
  knownRevision = revision;
  knownUri = uri;
  request("api/params").then(accept, refuse);
}

function accept(answer) {
  error.hidden = true;
  knownRevision = Math.max(knownRevision, answer.revision);
  set("params", answer);
  if (!controls.size) build(answer);
  presets.value = answer.preset;
  for (const [name, one] of controls) {
    const needed = MODEL_OF[name];
    one.show(answer.values[name], answer.base[name], answer.effective[name] ?? null, Boolean(needed) && needed !== answer.values["alignment.model"]);
  }
  for (const [name, { count }] of sections) {
    const changed = Object.keys(answer.values).filter((key) => key.startsWith(`${name}.`) && answer.values[key] !== answer.base[key]).length;
    count.textContent = changed ? `${changed} changed` : "";
  }
}

function refuse(problem) {
  error.textContent = problem.message;
  error.hidden = false;
}

function build({ sections: described, presets: names }) {
  presets.append(...names.map((name) => el("option", { value: name, textContent: name })));
  const open = new Set(memory.read("sections", OPEN_AT_FIRST));
  const order = [...described].sort((a, b) => Number(b.name === FIRST_SECTION) - Number(a.name === FIRST_SECTION));
  for (const section of order) {
    const count = el("span", { class: "count" });
    const node = el("details", { class: "section", open: open.has(section.name), data: { section: section.name } },
      el("summary", { title: section.help }, section.name.replaceAll("_", " "), count));
    node.addEventListener("toggle", rememberOpen);
    sections.set(section.name, { node, count, help: section.help });
    for (const param of section.params) {
      const name = `${section.name}.${param.key}`;
      const one = control(name, param, (value) => change(name, value));
      one.node.classList.toggle("is-prominent", PROMINENT.has(name));
      controls.set(name, one);
      node.append(one.node);
    }
    list.append(node);
  }
}

function change(name, value) {
  const model = MODEL_OF[name];
  submit({ [name]: value, ...(model && value !== null ? { "alignment.model": model } : {}) });
}

function choosePreset(name) {
  request("api/params/preset", "POST", { name }).then(accept, refuse);
}

function rememberOpen() {
  if (search.value) return;
  memory.write("sections", [...sections].filter(([, { node }]) => node.open).map(([name]) => name));
}

/** Show what matches the words, with its sections open. */
function filter() {
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  const remembered = new Set(memory.read("sections", OPEN_AT_FIRST));
  for (const [section, { node, help }] of sections) {
    let any = false;
    for (const [name, one] of controls) {
      if (!name.startsWith(`${section}.`)) continue;
      const about = `${name} ${one.help} ${help}`.replaceAll("_", " ").toLowerCase();
      one.node.hidden = !words.every((word) => about.includes(word));
      any ||= !one.node.hidden;
    }
    node.hidden = !any;
    node.open = words.length ? any : remembered.has(section);
  }
}
