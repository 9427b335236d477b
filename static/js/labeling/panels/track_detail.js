/** Details of the selected track: actions, position in this frame, history. */
import { el, text } from "../../core/dom.js";
import { num, percent } from "../../core/format.js";
import { on, paint } from "../../core/store.js";
import * as commands from "../acts/commands.js";
import { classNames, fill } from "../state/classes.js";
import { presentOf } from "../state/draft.js";
import { boxOf, isFollowing } from "../views/image_drawing.js";
import { chosen, nameOf } from "../state/labels.js";
import { setTool } from "../state/mode.js";
import { Past } from "./history_list.js";
import * as attributes from "./attributes.js";
import * as closeUp from "./close_up.js";
import * as numbers from "./numbers.js";
import * as review from "../acts/review.js";

const head = el("div", { class: "detail-head" }),
  title = el("b", {}),
  state = el("span", { class: "tag" });
const classes = el("select", { aria: { label: "Class" }, title: "Class (T)" });
const facts = el("p", { class: "facts" }),
  comment = el("p", { class: "comment" }),
  how = el("p", { class: "how" }),
  past = new Past();
const panel = el("div", { class: "track-detail", hidden: true });

/** @param {HTMLElement} parent */
export function setUp(parent) {
  const button = (
    /** @type {string} */ words,
    /** @type {string} */ key,
    /** @type {string} */ help,
    /** @type {() => unknown} */ onclick,
  ) => el("button", { type: "button", title: `${help} (${key})`, onclick }, words);
  classes.addEventListener("change", () => {
    commands.relabel(classes.value);
    classes.blur();
  });
  head.append(title, state, el("span", { class: "spacer" }), classes);
  panel.append(
    head,
    facts,
    how,
    comment,
    el(
      "div",
      { class: "detail-buttons" },
      button("Accept", "A", "Accept the whole track", () => commands.judge("accept")),
      button("Reject", "R", "Reject the whole track", () => commands.judge("reject")),
      button("Send back", "H", "Send back with a comment", review.sendBack),
      button("Reviewed", "Shift H", "Approve as a second annotator", review.reviewOk),
      button("Snap", "S", "Fit the cuboid to the points", commands.snap),
      button("Extend", "Shift C", "Extend the track to earlier and later frames, as far as it is found", () =>
        commands.propagate("both"),
      ),
      button("Reverse", "Shift X", "Swap front and rear of the whole track", commands.flip),
      button("Apply size", "W", "Apply this size to the whole track", commands.sizeAlong),
      button("Keyframe", "K", "Set a keyframe in this frame", commands.keyframe),
      button("Reset box", "Shift S", "Make the image box follow the cuboid again", commands.boxFollows),
      button("Draw", "Shift G", "Draw the shape in this frame", () => setTool("shape")),
      button("Remove", "Del", "Remove from this frame or the marked frames", commands.notHere),
      button("Split", "X", "Split the track from this frame on", commands.splitHere),
      button("Merge", "M", "Merge with another label: click it, or select it with . and press Enter", commands.merge),
      button("Delete", "Shift Del", "Delete the track", commands.removeTrack),
    ),
    numbers.node,
    closeUp.node,
    attributes.node,
    past.node,
  );
  parent.append(panel);
  numbers.setUp();
  attributes.setUp();
  closeUp.setUp();
  on(["classes"], () => fill(classes));
  paint(["track", "labels", "classes", "labelFrames", "frame", "draft", "projected"], show);
  on(["track", "labels"], () => {
    const track = chosen();
    if (track) past.look("track", track.id, track.revision);
  });
}

/** A class that people here cannot choose, from a file or a detector, is shown too. @param {string} label */
function showClass(label) {
  classes.querySelector(".foreign")?.remove();
  const isForeign = !classNames().includes(label);
  if (isForeign) classes.append(el("option", { class: "foreign", value: label, textContent: label }));
  classes.value = label;
}

/** How front and rear of a proposal were told apart. */
const HEADINGS = {
  "": "",
  motion: "heading from its motion",
  lane: "heading assumed from the lane",
  unknown: "front and rear unclear: reverse it (Shift X), or accept it as is",
};

function show() {
  const track = chosen();
  panel.hidden = !track;
  if (!track) return;
  text(title, nameOf(track));
  const sure = track.state === "proposed" && track.confidence !== null ? ` ${percent(track.confidence)}` : "";
  text(state, track.reviewer ? `reviewed by ${track.reviewer}` : track.state + sure);
  state.dataset.state = track.state;
  if (document.activeElement !== classes) showClass(track.label);
  text(comment, track.comment ? `Sent back: ${track.comment}` : "");
  text(how, track.origin.how ? `Placed by ${track.origin.name}: ${track.origin.how}` : "");
  text(facts, [placeWords(track, presentOf(track.id)), HEADINGS[track.heading]].filter(Boolean).join(" · "));
}

/** @param {import("../state/types.js").LabelSighting} sighting */
function boxWords(sighting) {
  if (!isFollowing(sighting)) return " · box set by hand";
  return boxOf(sighting.track) ? "" : " · outside the image";
}

/**
 * @param {import("../state/types.js").LabelTrack} track
 * @param {import("../state/types.js").LabelSighting|null} sighting
 */
function placeWords({ keyframes, origin }, sighting) {
  if (!sighting) return "not in this frame";
  const kind = sighting.keyframe
    ? "keyframe"
    : keyframes.length
      ? "interpolated between keyframes"
      : origin.maker === "pipeline"
        ? "as proposed by the pipeline"
        : "no keyframe";
  if (!sighting.cuboid)
    return `${kind} · image box only. Draw a cuboid in the plan (Shift G), or fit one to the points in the box (S)`;
  const {
    center: [x, y, z],
    size,
    yaw_rad,
  } = sighting.cuboid;
  const place = `${num(x, 2)} m ahead, ${num(Math.abs(y), 2)} m ${y >= 0 ? "left" : "right"}, middle at ${num(z, 2)} m`;
  const dimensions = `${size.map((each) => num(each, 1)).join(" × ")} m · ${num((yaw_rad * 180) / Math.PI, 0)}°`;
  return `${kind} · ${place} · ${dimensions}${boxWords(sighting)}`;
}
