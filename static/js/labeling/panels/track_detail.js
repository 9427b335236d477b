/** The selected track: what can be done with it, its place in this frame, and its history. */
import { el, text } from "../../core/dom.js";
import { DASH, num } from "../../core/format.js";
import { on, paint } from "../../core/store.js";
import * as commands from "../acts/commands.js";
import { CLASSES } from "../views/cuboid.js";
import { presentOf } from "../state/draft.js";
import { chosen, nameOf } from "../state/labels.js";
import { setTool } from "../state/mode.js";
import { Past } from "./history_list.js";
import * as review from "../acts/review.js";

const head = el("div", { class: "detail-head" }),
  title = el("b", {}),
  state = el("span", { class: "tag" });
const classes = el(
  "select",
  { aria: { label: "Class" }, title: "Class (T)" },
  ...CLASSES.map((label) => el("option", { value: label, textContent: label })),
);
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
      button("Send back", "H", "Send it back with a comment", review.sendBack),
      button("Reviewed", "Shift H", "A second person finds it right", review.reviewOk),
      button("Snap", "S", "Fit the cuboid to the points", commands.snap),
      button("Size along", "W", "This size along the whole track", commands.sizeAlong),
      button("Keyframe", "K", "It is right in this frame", commands.keyframe),
      button("Draw", "Shift G", "Draw its shape in this frame", () => setTool("shape")),
      button("Not here", "Del", "It is not there in this frame, or in the marked ones", commands.notHere),
      button("Split", "X", "From this frame on it is another", commands.splitHere),
      button(
        "Merge",
        "M",
        "Merge it with the label that is pressed next, or selected by . and taken by Enter",
        commands.merge,
      ),
      button("Remove", "Shift Del", "Remove the track", commands.removeTrack),
    ),
    past.node,
  );
  parent.append(panel);
  paint(["track", "labels", "labelFrames", "frame", "draft"], show);
  on(["track", "labels"], () => {
    const track = chosen();
    if (track) past.look("track", track.id, track.revision);
  });
}

function show() {
  const track = chosen();
  panel.hidden = !track;
  if (!track) return;
  text(title, nameOf(track));
  text(state, track.reviewer ? `reviewed by ${track.reviewer}` : track.state);
  state.dataset.state = track.state;
  if (document.activeElement !== classes) classes.value = track.label;
  text(comment, track.comment ? `Sent back: ${track.comment}` : "");
  text(how, track.origin.how ? `${track.origin.name} pointed at it: ${track.origin.how}` : "");
  text(facts, placeWords(track, presentOf(track.id)));
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
      ? "follows its keyframes"
      : origin.maker === "pipeline"
        ? "as the pipeline saw it"
        : "no keyframe";
  if (!sighting.cuboid)
    return `${kind} · box in the picture only: no LiDAR points tell where it is, and its height in the picture does so too roughly. Draw its cuboid (Shift G); where points are seen in its box, S lays it on them`;
  const {
    center: [x, y],
    size,
    yaw_rad,
  } = sighting.cuboid;
  return `${kind} · ${num(x, 2)} m ahead, ${num(Math.abs(y), 2)} ${y >= 0 ? "left" : "right"} · ${size.map((each) => num(each, 1)).join(" × ")} m · ${num((yaw_rad * 180) / Math.PI, 0)}°${sighting.bbox ? "" : ` · box ${DASH}`}`;
}
