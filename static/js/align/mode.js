/**
 * Alignment mode: align LiDAR and camera manually. Dragging shifts the point cloud and scrolling scales it. Every move
 * changes the alignment parameters; the server does the projection.
 */
import { newestOnly, request } from "../core/api.js";
import { $, el, press, text } from "../core/dom.js";
import { get, on, set } from "../core/store.js";
import { change, reveal } from "../panels/params.js";
import { filesButton, filesPanel } from "./files.js";
import { alignmentFit, positionSwitch, timeFit } from "./fit.js";
import { drawRegions, rangesRow, regionsButton, showRegions } from "./regions.js";
import { drawPairs } from "./pair_drawing.js";
import { fill as fillPairs, nextStep } from "./pair_panel.js";
import { followPresses } from "./pair_pointer.js";
import { isPairing, setUp as setUpPairs, toggle as togglePairs } from "./pairs.js";
import { versionsButton, versionsPanel } from "./versions.js";
import { followHand } from "./pointer.js";
import { drawEdges } from "./image_edges.js";
import { addLayer } from "../views/camera.js";
import { grow, resetInspector } from "../workspace/panes.js";

/** Pause between two scores during a drag: each takes the server 0.1 s. */
const PAUSE_MS = 250;
const OFF = { on: false, blend: 0.5, edges: true, regions: true };

const bar = $("#align-bar"),
  button = $("#align-button");
const score = el("b", {
  class: "score",
  title: "How well LiDAR depth edges match image edges",
  textContent: "computing …",
});
const how = el("span", { class: "how" });
/** The score by distance and what dragging does: in a row of their own, so that the bar fits into one. */
const below = el("div", { class: "facts match-row", hidden: true }, rangesRow, how);

const fetchScore = newestOnly(async () => {
  const found = /** @type {import("../core/types.js").AlignmentScore|Error} */ (
    await request("api/alignment/score").catch((error) => error)
  );
  text(score, found instanceof Error ? "no score" : found.brief);
  score.title = found instanceof Error ? found.message : found.text;
  showRegions(found instanceof Error ? null : found);
  if (isOn()) set("align", { ...(get("align") ?? OFF) }); // paints the regions
  await new Promise((done) => setTimeout(done, PAUSE_MS));
});

export function setUp() {
  set("align", OFF);
  button.addEventListener("click", toggleAlign);
  bar.append(
    model("angular"),
    model("pinhole"),
    el("span", { class: "facts match", textContent: "Match" }),
    score,
    alignmentFit.control,
    positionSwitch,
    timeFit.control,
    pairsButton(),
    versionsButton,
    filesButton,
    el("span", { class: "spacer" }),
    blendSlider(),
    edgesButton(),
    regionsButton,
  );
  bar.after(below, el(
      "div",
      { class: "fit-place" },
      el("div", { class: "fits" }, alignmentFit.panel, timeFit.panel, filesPanel),
      versionsPanel,
    ),
  );
  fillPairs($("#pair-pane"));
  setUpPairs();
  followHand($("#camera", HTMLCanvasElement), () => isOn() && !isPairing());
  followPresses($("#camera", HTMLCanvasElement));
  addLayer((ctx, frame, place) => isOn() && get("align")?.edges && drawEdges(ctx, frame, place));
  addLayer((ctx, frame, place) => isOn() && get("align")?.regions && drawRegions(ctx, frame, place), "over");
  addLayer(drawPairs, "over");
  on(["frame"], () => isOn() && fetchScore(undefined));
  on(["align", "params", "pairs"], reflect);
}

const isOn = () => get("align")?.on === true;
const isAngular = () => get("params")?.values["alignment.model"] === "angular";

export function toggleAlign() {
  set("align", { ...(get("align") ?? OFF), on: !isOn() });
  if (isOn() !== (get("layout")?.grown === "camera")) grow("camera");
  if (!isOn()) return pairUp(false);
  revealSliders(get("params")?.values["alignment.model"]);
  resetInspector(); // in a narrow window, the sliders would cover the image that is being aligned
  fetchScore(undefined);
}

/** The first slider of a model. @param {unknown} model */
function revealSliders(model) {
  reveal(model === "angular" ? "alignment.h_res_deg" : "alignment.yaw_deg");
}

function reflect() {
  bar.hidden = below.hidden = !isOn();
  $(".fit-place").hidden = !isOn();
  press(button, isOn());
  document.body.classList.toggle("is-aligning", isOn());
  text(how, isPairing() ? nextStep() : drag());
  for (const choice of bar.querySelectorAll("[data-model]"))
    press(choice, /** @type {HTMLElement} */ (choice).dataset.model === get("params")?.values["alignment.model"]);
}

const drag = () =>
  isAngular() ? "Drag: origin · scroll: h_res and v_res · Shift + scroll: v_res" : "Drag: yaw, pitch · scroll: roll";

/** Pick pairs, or drag again. @param {boolean} isOn */
function pairUp(isOn) {
  if (isOn === isPairing()) return;
  const shown = { edges: !isOn, regions: !isOn }; // they would cover what is picked
  set("align", { ...(get("align") ?? OFF), ...shown });
  togglePairs(isOn);
  if (!isOn) revealSliders(get("params")?.values["alignment.model"]); // the pane of pairs was in their place
}

function pairsButton() {
  const pairs = el("button", {
    type: "button",
    textContent: "Pairs",
    title: "Pick LiDAR points and the pixels where they belong, and fit the alignment to them",
    onclick: () => pairUp(!isPairing()),
  });
  on(["pairs"], () => press(pairs, isPairing()));
  return pairs;
}

/** @param {string} name */
function model(name) {
  const choose = () => {
    change({ "alignment.model": name }, true);
    revealSliders(name);
  };
  return el("button", { type: "button", textContent: name, data: { model: name }, onclick: choose });
}

function blendSlider() {
  const range = el("input", {
    type: "range",
    min: "0",
    max: "1",
    step: "0.01",
    value: String(OFF.blend),
    aria: { label: "Blend image and point cloud" },
  });
  range.addEventListener("input", () => set("align", { ...(get("align") ?? OFF), blend: Number(range.value) }));
  return el("label", { class: "blend" }, "Image", range, "Points");
}

function edgesButton() {
  const edges = el("button", { type: "button", textContent: "Edges", title: "Show image edges" });
  edges.addEventListener("click", () => set("align", { ...(get("align") ?? OFF), edges: !get("align")?.edges }));
  on(["align"], () => press(edges, get("align")?.edges === true));
  return edges;
}
