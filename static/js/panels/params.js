/** The parameter panel, built from the server's schema. Changes are sent at once, newest only. */
import { newestOnly, request } from "../core/api.js";
import { $, el, memory, text } from "../core/dom.js";
import { control } from "./param_control.js";
import { knownName } from "../labeling/state/person.js";
import { get, on, paintAfter, set } from "../core/store.js";
import { toggle } from "../workspace/panes.js";

/** @typedef {import("../core/types.js").ParamValue} ParamValue */
/** @typedef {import("../core/types.js").ParamsAnswer} ParamsAnswer */
/** @typedef {{changes: Record<string, ParamValue>, final: boolean}} Changes */

const OPEN_AT_FIRST = ["alignment", "cluster"];
const FIRST_SECTION = "alignment";
/** Changing one of these parameters selects its model. @type {Record<string, string>} */
const MODEL_OF = {
  "alignment.h_res_deg": "angular",
  "alignment.v_res_deg": "angular",
  "alignment.cx_px": "angular",
  "alignment.cy_px": "angular",
  "alignment.yaw_deg": "pinhole",
  "alignment.pitch_deg": "pinhole",
  "alignment.roll_deg": "pinhole",
  "alignment.forward_m": "pinhole",
  "alignment.left_m": "pinhole",
  "alignment.up_m": "pinhole",
  "alignment.zoom": "pinhole",
};
const PROMINENT = new Set(["alignment.h_res_deg", "alignment.v_res_deg"]);

const error = el("p", { class: "params-error", aria: { role: "alert" }, hidden: true });
const list = el("div", { class: "params-list" });
const presets = el("select", { aria: { label: "Preset" } });
const search = el("input", {
  type: "search",
  placeholder: "Search parameters",
  aria: { label: "Search parameters" },
  oninput: filter,
});
const nothing = el("p", {
  class: "facts",
  aria: { role: "status" },
  textContent: "No matching parameters.",
  hidden: true,
});
/** @type {Map<string, ReturnType<typeof control>>} */
const controls = new Map();
/** @type {Map<string, {node: HTMLDetailsElement, count: HTMLElement, help: string}>} */
const sections = new Map();
let knownRevision = -1;
/** @type {string|null} */
let knownUri = null;

const submit = newestOnly(
  (/** @type {Changes} */ body) =>
    request("api/params", "PATCH", { ...body, person: knownName() }).then(accept, refuse),
  (waiting, newer) => ({ changes: { ...waiting.changes, ...newer.changes }, final: waiting.final || newer.final }),
);

let told = Promise.resolve();
/** Resolves once the server has answered all changes so far. */
export const settled = () => told;

export function setUp() {
  const download = el("a", {
    href: "api/params.yaml",
    textContent: "Save preset",
    title: "YAML file for `cipv run --params FILE`",
  });
  download.setAttribute("download", "cipv-params.yaml");
  presets.addEventListener("change", () => choosePreset(presets.value));
  $("#params").append(
    el(
      "div",
      { class: "params-top" },
      el(
        "div",
        { class: "row" },
        el("span", { class: "facts", textContent: "Preset" }),
        presets,
        el("button", {
          type: "button",
          textContent: "Reset",
          title: "Reset all parameters to the preset values",
          onclick: () => choosePreset(presets.value),
        }),
        download,
      ),
      search,
      error,
      nothing,
    ),
    list,
  );
  on(["state"], refreshIfForeign);
  on(["params"], () => (knownRevision = Math.max(knownRevision, get("params")?.revision ?? -1)));
  paintAfter(["params"], show); // there are a hundred controls: draw the frame first
}

/** Reload after changes by another browser, the 3D view or another recording. */
function refreshIfForeign() {
  const state = get("state");
  if (!state || state.frame === null || (state.params_revision <= knownRevision && state.uri === knownUri)) return;
  knownRevision = state.params_revision;
  knownUri = state.uri;
  request(`api/params?person=${encodeURIComponent(knownName())}`).then(accept, refuse);
}

/** @param {ParamsAnswer} answer */
function accept(answer) {
  error.hidden = true;
  set("params", answer);
}

function show() {
  const answer = get("params");
  if (!answer) return;
  if (!controls.size) build(answer);
  if (presets.value !== answer.preset) presets.value = answer.preset;
  for (const [name, one] of controls) {
    const needed = MODEL_OF[name];
    one.show(
      answer.values[name],
      answer.base[name],
      answer.effective[name] ?? null,
      Boolean(needed) && needed !== answer.values["alignment.model"],
    );
  }
  for (const [name, { count }] of sections) {
    const changed = Object.keys(answer.values).filter(
      (key) => key.startsWith(`${name}.`) && answer.values[key] !== answer.base[key],
    ).length;
    text(count, changed ? `${changed} changed` : "");
  }
}

/** @param {Error} problem */
function refuse(problem) {
  error.textContent = problem.message;
  error.hidden = false;
}

/** @param {ParamsAnswer} answer */
function build({ sections: described, presets: names }) {
  presets.append(...names.map((name) => el("option", { value: name, textContent: name })));
  const order = [...described].sort((a, b) => Number(b.name === FIRST_SECTION) - Number(a.name === FIRST_SECTION));
  for (const section of order) {
    const count = el("span", { class: "count" });
    const node = el(
      "details",
      { class: "section", data: { section: section.name } },
      el("summary", { title: section.help }, section.name.replaceAll("_", " "), count),
    );
    node.addEventListener("toggle", rememberOpen);
    sections.set(section.name, { node, count, help: section.help });
    for (const param of section.params) {
      const name = `${section.name}.${param.key}`;
      const one = control(name, param, (value, isFinal) => change({ [name]: value }, isFinal));
      one.node.classList.toggle("is-prominent", PROMINENT.has(name));
      controls.set(name, one);
      node.append(one.node);
    }
    list.append(node);
  }
  filter();
}

/**
 * Change parameters by dotted name. While input continues, `isFinal` is false: only the current frame is recomputed,
 * the whole drive waits for the final value.
 * @param {Record<string, ParamValue>} changes
 * @param {boolean} isFinal
 */
export function change(changes, isFinal) {
  const model = Object.entries(changes)
    .map(([name, value]) => (value === null ? undefined : MODEL_OF[name]))
    .find(Boolean);
  told = submit({ changes: { ...changes, ...(model ? { "alignment.model": model } : {}) }, final: isFinal });
}

/** Reveal one parameter. @param {string} name @returns {HTMLElement|null} its control */
export function reveal(name) {
  toggle("params", true);
  $("#tab-params").click();
  search.value = "";
  filter();
  const section = sections.get(name.split(".")[0]),
    node = controls.get(name)?.node;
  if (!section || !node) return null;
  section.node.open = true;
  node.scrollIntoView({ block: "start" }); // the pane gets shorter when more is said above it
  return $("input, .choices button", HTMLElement, node);
}

/** @param {string} name */
function choosePreset(name) {
  request("api/params/preset", "POST", { name }).then(accept, refuse);
}

function rememberOpen() {
  if (search.value) return;
  memory.write(
    "sections",
    [...sections].filter(([, { node }]) => node.open).map(([name]) => name),
  );
}

/** Normalise text for search: "z weight" finds `z_weight` and vice versa. @param {string} text */
const plain = (text) => text.replaceAll("_", " ").toLowerCase();

/** Show matching parameters and open their sections. */
function filter() {
  const words = plain(search.value).split(/\s+/).filter(Boolean);
  const remembered = new Set(memory.read("sections", OPEN_AT_FIRST));
  for (const [section, { node, help }] of sections) {
    let any = false;
    for (const [name, one] of controls) {
      if (!name.startsWith(`${section}.`)) continue;
      const about = plain(`${name} ${one.help} ${help}`);
      one.node.hidden = !words.every((word) => about.includes(word));
      any ||= !one.node.hidden;
    }
    node.hidden = !any;
    node.open = words.length ? any : remembered.has(section);
  }
  nothing.hidden = !words.length || [...sections.values()].some(({ node }) => !node.hidden);
}
