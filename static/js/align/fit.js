/** The two fits to the whole recording: the alignment of LiDAR and camera, and the time offsets of the sensors. */
import { el } from "../core/dom.js";
import { get, on } from "../core/store.js";
import { fitJob } from "./fit_job.js";
import { labelOf } from "./parameter_values.js";
import { save as saveVersion } from "./versions.js";

const yaml = el("a", {
  class: "button",
  href: "api/alignment/fit.yaml",
  textContent: "Save YAML",
  title: "Parameters for `cipv run --params FILE`",
});
yaml.setAttribute("download", "cipv-alignment.yaml");

/** The alignment model in use. */
export const model = () => get("params")?.values["alignment.model"] ?? "pinhole";

const position = el("input", { type: "checkbox" });
/** The switch for `fitsPosition`. */
export const positionSwitch = el(
  "label",
  { class: "check", title: "Also fit the camera's lateral and vertical position; makes the angles less certain" },
  position,
  "Position",
);
/** Whether a fit is to move the camera, too. */
export const fitsPosition = () => model() === "pinhole" && position.checked;
on(["params"], () => {
  position.disabled = model() !== "pinhole"; // the angular model has no position
  positionSwitch.classList.toggle("is-off", position.disabled);
});

/** The button with its progress, and the panel with the result. */
export const alignmentFit = fitJob(
  /** @type {import("./fit_job.js").FitKind<import("../core/types.js").AlignmentFitResult>} */ ({
    button: "Fit",
    title: "Fit the alignment to the vehicles of the whole recording",
    running: "Fitting the alignment",
    panel: "Fitted alignment",
    address: "api/alignment/fit",
    asked: () => ({ model: model(), offset: fitsPosition() }),
    heading: ({ pairs, frames }) => `Fitted to ${pairs} vehicles in ${frames} frames`,
    said: (found) => found.text,
    label: labelOf,
    more: yaml,
    applied: () => saveVersion("Fit"), // its score belongs to the fit that the server still has
  }),
);

const TIMES = new Map([
  ["sync.camera_offset_ms", "Camera"],
  ["sync.ego_offset_ms", "Ego speed"],
]);

/** The button with its progress, and the panel with the result. */
export const timeFit = fitJob(
  /** @type {import("./fit_job.js").FitKind<import("../core/types.js").TimeFitResult>} */ ({
    button: "Time",
    title: "Find the time offsets of camera and ego speed from the motion in the whole recording",
    running: "Finding the time offsets",
    panel: "Time offsets",
    address: "api/alignment/time",
    heading: ({ images, speeds }) => `Time offsets from ${images} images and ${speeds} speeds`,
    said: () => "Added to the timestamps of live sensors once applied. This recording stays as it is.",
    label: (name) => TIMES.get(name) ?? name,
  }),
);
