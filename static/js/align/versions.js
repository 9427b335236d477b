/** Saved alignments with date, drive, score and note. Restoring one is a change of parameters like any other. */
import { request } from "../core/api.js";
import { el, text } from "../core/dom.js";
import { on } from "../core/store.js";
import { withUnit } from "./parameter_values.js";
import { change, settled } from "../panels/params.js";

/** @typedef {import("../core/types.js").AlignmentVersion} AlignmentVersion */

const note = el("input", { type: "text", maxLength: 200, placeholder: "Note", aria: { label: "Note" } });
const list = el("ul", { class: "versions" });
const said = el("p", { aria: { role: "status" } });
const form = el(
  "form",
  { class: "row" },
  note,
  el("button", { class: "primary", textContent: "Save", title: "Save the current alignment" }),
);
form.addEventListener("submit", (event) => {
  event.preventDefault();
  save(note.value);
});
/** The list, below the bar. */
export const versionsPanel = el(
  "section",
  { class: "fit-result versions-panel", aria: { label: "Saved alignments" }, hidden: true },
  el("b", { textContent: "Saved alignments" }),
  form,
  said,
  list,
);
/** Shows and hides the list. */
export const versionsButton = el("button", {
  type: "button",
  textContent: "Versions",
  title: "Save the alignment, or restore a saved one",
  onclick: toggle,
});
versionsButton.setAttribute("aria-expanded", "false");

on(["params"], () => !versionsPanel.hidden && refresh());

function toggle() {
  versionsPanel.hidden = !versionsPanel.hidden;
  versionsButton.setAttribute("aria-expanded", String(!versionsPanel.hidden));
  if (!versionsPanel.hidden) refresh();
}

/** Save the current alignment, once the server has the newest parameters. @param {string} words */
export async function save(words) {
  await settled();
  await request("api/alignment/versions", "POST", { note: words }).then(() => (note.value = ""), fail);
  await refresh();
}

async function refresh() {
  const versions = /** @type {AlignmentVersion[]|null} */ (
    await request("api/alignment/versions").catch((error) => fail(error))
  );
  if (!versions) return;
  text(said, versions.length ? "" : "None yet. Applying a fit saves one.");
  said.hidden = versions.length > 0;
  list.replaceChildren(...versions.map(row));
}

/** @param {AlignmentVersion} version */
function row(version) {
  const when = new Date(version.saved_at);
  const restore = el("button", {
    type: "button",
    textContent: version.is_present ? "Current" : "Restore",
    disabled: version.is_present,
    title: "Use this alignment (can be undone)",
    aria: { label: `Restore alignment ${version.id}` },
    onclick: () => change(version.values, true),
  });
  const remove = el("button", {
    type: "button",
    class: "quiet",
    textContent: "Delete",
    aria: { label: `Delete alignment ${version.id}` },
    onclick: () => request(`api/alignment/versions/${version.id}`, "DELETE").then(refresh, fail),
  });
  return el(
    "li",
    { aria: version.is_present ? { current: "true" } : {} },
    el(
      "div",
      {},
      el("time", { dateTime: version.saved_at, textContent: when.toLocaleString() }),
      el("span", { class: "facts", textContent: ` ${version.drive}` }),
      el("p", { textContent: [score(version), values(version), version.note].filter(Boolean).join(" · ") }),
    ),
    restore,
    remove,
  );
}

/** @param {AlignmentVersion} version */
function score({ match, iou }) {
  const overlap = iou === null ? "" : `IoU ${(100 * iou).toFixed(0)} %`;
  return overlap || (match === null ? "no score" : `match ${(100 * match).toFixed(0)} %`);
}

/** @param {AlignmentVersion} version */
function values({ values: all }) {
  const of = (/** @type {string} */ name) => withUnit(name, Number(all[`alignment.${name}`] ?? NaN));
  if (all["alignment.model"] === "angular")
    return all["alignment.h_res_deg"] === null
      ? "angular"
      : `h_res ${of("h_res_deg")}, v_res ${of("v_res_deg")}`;
  return `yaw ${of("yaw_deg")}, pitch ${of("pitch_deg")}, roll ${of("roll_deg")}`;
}

/** @param {Error} problem @returns {null} */
function fail(problem) {
  said.hidden = false;
  text(said, problem.message);
  return null;
}
