/** The labeling mode: the pipeline proposes labels, people correct them. */
import { $, isReloaded, press, tabMemory } from "../../core/dom.js";
import { get, on, set } from "../../core/store.js";
import * as playhead from "../../drive/own_playhead.js";
import { resetInspector, toggle as togglePane } from "../../workspace/panes.js";
import { personName } from "./person.js";

/** @type {import("../../core/store.js").Labeling} */
const OFF = { on: false, tool: null, from: null, hasObjects: false, review: false, item: null, follows: false };

const button = $("#label-button", HTMLButtonElement);

/** Whether labeling was on when the page was reloaded, and is to go on. */
let resumes = isReloaded() && tabMemory.read("labeling", false);

export function setUp() {
  set("labeling", OFF);
  button.addEventListener("click", toggle);
  on(["labeling", "state", "frame"], reflect);
  on(["labeling", "layout", "frame"], place);
}

export const isOn = () => get("labeling")?.on === true;

const canLabel = () => get("state")?.labels != null;

export function toggle() {
  if (!isOn() && !canLabel()) return;
  change({ ...OFF, on: !isOn(), hasObjects: get("labeling")?.hasObjects ?? false });
  tabMemory.write("labeling", isOn());
  set("draft", null);
  set("marked", null);
  set("trimmed", null);
  if (!isOn()) return resetInspector();
  togglePane("params", true); // the labels panel is in the inspector column
  personName();
}

/** A page that labels has its own playhead: nobody moves it to another frame, nor is moved. */
function place() {
  if (!isOn()) playhead.end(false);
  else if (get("labeling")?.follows || playhead.isShared()) playhead.end(playhead.isShared());
  else playhead.begin();
}

/** Follow the shared playhead, or leave it. */
export const toggleFollows = () => change({ follows: !get("labeling")?.follows });

/** @type {Record<string, string>} */
const HINTS = {
  new: "New label: drag in the plan, drag a box or click in the image, or press Enter. Esc cancels",
  shape: "Shape: drag in the plan, drag a box in the image, Enter for a box, G for a cuboid. Esc cancels",
  path: "Path: drag along its centre in the plan, or bend it with arrows; Enter keeps it. Esc cancels",
};

/**
 * Choose what the next drag or click does, and show a hint.
 * @param {import("../../core/store.js").Labeling["tool"]} tool
 */
export function setTool(tool) {
  const next = get("labeling")?.tool === tool ? null : tool;
  if (next === "shape" && get("track") === null) return set("said", "Select a label first");
  if (next || Object.values(HINTS).includes(get("said") ?? "")) set("said", (next && HINTS[next]) ?? "");
  change({ tool: next, from: next === "merge" ? get("track") : null });
  if (next === null) set("drawnPath", null);
}

/** Set the label under review, or null. @param {import("../../core/store.js").Labeling["item"]} item */
export const setItem = (item) => change({ item });

/** @param {boolean} review */
export const setReview = (review) => change({ review, item: null, tool: null });

export function toggleObjects() {
  change({ hasObjects: !get("labeling")?.hasObjects });
}

/** Cancel one thing, the most recent first. @returns {boolean} whether there was something to cancel */
export function cancel() {
  if (get("trimmed")) set("trimmed", null);
  else if (get("labeling")?.tool) setTool(null);
  else if (get("marked")) set("marked", null);
  else if (get("track") !== null) set("track", null);
  else if (get("labeling")?.review) setReview(false);
  else return false;
  return true;
}

/** @param {Partial<import("../../core/store.js").Labeling>} changes */
function change(changes) {
  set("labeling", { ...(get("labeling") ?? OFF), ...changes });
}

function reflect() {
  if (resumes && get("frame") && canLabel()) {
    resumes = false;
    if (!isOn()) return toggle();
  }
  if (isOn() && get("state") && !canLabel()) return change({ on: false, tool: null });
  press(button, isOn());
  button.disabled = !canLabel();
  document.body.classList.toggle("is-labeling", isOn());
  document.body.classList.toggle("is-reviewing", isOn() && get("labeling")?.review === true);
  document.body.dataset.tool = get("labeling")?.tool ?? "";
  $("#label-bar").hidden = $("#label-keys").hidden = $("#label-pane").hidden = !isOn();
}
