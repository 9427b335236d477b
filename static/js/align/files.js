/**
 * Calibrations of other tools. A file is read by the server as alignment parameters; it changes nothing until it is
 * applied, as one step that can be undone.
 */
import { request } from "../core/api.js";
import { el, press, text } from "../core/dom.js";
import { get, on } from "../core/store.js";
import { change } from "../panels/params.js";
import { valuesOf } from "./parameter_values.js";
import { save as saveVersion } from "./versions.js";

/** @typedef {import("../core/types.js").AlignmentImport} AlignmentImport */

const FORMATS = [
  ["kitti", "KITTI", "calib.txt with P2, R0_rect and Tr_velo_to_cam"],
  ["ros", "ROS", "camera_info.yaml and static_transform.yaml, as .zip"],
  ["opencv", "OpenCV", "YAML with camera_matrix, distortion_coefficients and T_camera_lidar"],
  ["kalibr", "Kalibr", "camchain.yaml and transform.yaml with T_cam_lidar, as .zip"],
  ["rig", "Rig file", "For captures, PCD folders and ROS bags, with the mounts as positions and angles"],
];

const chosen = el("input", { type: "file", multiple: true, aria: { label: "Files to import" } });
chosen.addEventListener("change", read);
const heading = el("b", {}),
  values = el("dl", { class: "pairs" }),
  said = el("p", {}),
  warnings = el("ul", { class: "warnings" });
const apply = el("button", { type: "button", class: "primary", textContent: "Apply" });
const found = el(
  "div",
  { aria: { label: "Imported calibration", role: "status" }, hidden: true },
  heading,
  values,
  el("div", { class: "row" }, apply, el("button", { type: "button", textContent: "Dismiss", onclick: dismiss })),
  said,
  warnings,
);
const choices = el(
  "div",
  {},
  el("b", { textContent: "Import" }),
  el("p", {
    textContent: "KITTI (of raw data both files), ROS (both files), OpenCV or Kalibr. The format is recognised.",
  }),
  chosen,
  el("b", { class: "next", textContent: "Export with the current alignment" }),
  el("div", { class: "row" }, ...FORMATS.map(([name, words, title]) => exportLink(name, words, title))),
);
/** Import and export, below the bar. */
export const filesPanel = el(
  "section",
  { class: "fit-result", aria: { label: "Calibration files" }, hidden: true },
  choices,
  found,
);
/** Shows and hides them. */
export const filesButton = el("button", {
  type: "button",
  textContent: "Files",
  title: "Import or export a calibration of KITTI, ROS, OpenCV or Kalibr",
  onclick: toggle,
});
filesButton.setAttribute("aria-expanded", "false");

filesButton.disabled = true;
on(["frame"], () => (filesButton.disabled = !get("frame"))); // a file needs the camera that a frame has

function toggle() {
  filesPanel.hidden = !filesPanel.hidden;
  filesButton.setAttribute("aria-expanded", String(!filesPanel.hidden));
  press(filesButton, !filesPanel.hidden);
}

/** @param {string} name @param {string} words @param {string} title */
function exportLink(name, words, title) {
  const link = el("a", { class: "button", href: `api/alignment/export?format=${name}`, textContent: words, title });
  link.setAttribute("download", "");
  return link;
}

async function read() {
  const files = [...(chosen.files ?? [])];
  if (!files.length) return;
  const contents = await Promise.all(files.map(async (file) => ({ name: file.name, text: await file.text() })));
  request("api/alignment/import", "POST", { files: contents }).then((answer) => show(answer, files), fail);
}

/** @param {AlignmentImport} answer @param {File[]} files */
function show({ format, changes, text: sentence, warnings: doubts }, files) {
  const names = files.map((file) => file.name).join(", ");
  text(heading, `${format}: ${names}`);
  values.replaceChildren(...valuesOf(changes));
  text(said, sentence);
  warnings.replaceChildren(...doubts.map((textContent) => el("li", { textContent })));
  warnings.hidden = !doubts.length;
  apply.hidden = found.hidden = false;
  choices.hidden = true; // so that Apply is in sight in a small window
  apply.onclick = async () => {
    change(/** @type {any} */ (changes), true);
    await saveVersion(`Imported from ${names}`.slice(0, 200));
    dismiss();
  };
}

/** @param {Error} problem */
function fail(problem) {
  text(heading, "Not imported");
  values.replaceChildren();
  text(said, problem.message);
  warnings.hidden = apply.hidden = true;
  found.hidden = false;
  choices.hidden = true;
}

function dismiss() {
  found.hidden = true;
  choices.hidden = false;
  chosen.value = ""; // so that the same file can be chosen again
}
