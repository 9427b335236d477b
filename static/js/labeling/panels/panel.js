/** The labels panel in the inspector column: tracks, frame, score and files. */
import { $, el } from "../../core/dom.js";
import * as checks from "./checks_tab.js";
import * as detail from "./track_detail.js";
import * as files from "./files_tab.js";
import * as moment from "./frame_tab.js";
import * as score from "./score_tab.js";
import * as tracks from "./track_list.js";

const TABS = /** @type {const} */ ([
  ["tracks", "Tracks"],
  ["moment", "Frame"],
  ["checks", "Checks"],
  ["score", "Score"],
  ["files", "Files"],
]);

const bodies = {
  tracks: el("div", { class: "label-tracks" }),
  moment: el("div", { class: "label-files" }),
  checks: el("div", { class: "label-files" }),
  score: el("div", { class: "label-score" }),
  files: el("div", { class: "label-files" }),
};

export function setUp() {
  const buttons = TABS.map(([key, words]) =>
    el("button", {
      type: "button",
      id: `tab-label-${key}`,
      textContent: words,
      data: { tab: key },
      aria: { role: "tab", controls: `label-${key}` },
      onclick: () => show(key),
    }),
  );
  for (const [key] of TABS) Object.assign(bodies[key], { id: `label-${key}`, role: "tabpanel" });
  $("#label-pane").append(
    el(
      "div",
      { class: "pane-bar" },
      el("div", { class: "tabs", aria: { role: "tablist", label: "Labels" } }, ...buttons),
      el("span", { class: "spacer" }),
      files.exportButton(),
    ),
    ...TABS.map(([key]) => bodies[key]),
  );
  tracks.setUp(bodies.tracks);
  detail.setUp(bodies.tracks);
  moment.setUp(bodies.moment);
  checks.setUp(bodies.checks);
  score.setUp(bodies.score);
  files.setUp(bodies.files);
  show("tracks");
}

/** @param {keyof typeof bodies} shown */
function show(shown) {
  for (const [key] of TABS) {
    bodies[key].hidden = key !== shown;
    $(`#tab-label-${key}`).setAttribute("aria-selected", String(key === shown));
  }
  if (shown === "checks") checks.look(undefined);
  if (shown === "score") score.look(undefined);
  if (shown === "files") files.look();
}
