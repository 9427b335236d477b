/** Keyboard shortcuts of the labeling mode. They take precedence while it is on. */
import { playback } from "../core/api.js";
import { get } from "../core/store.js";
import * as byKeys from "./acts/keyboard_drawing.js";
import * as commands from "./acts/commands.js";
import { bringHere } from "./acts/range_ends.js";
import { cancel, isOn, setTool, toggleObjects } from "./state/mode.js";
import * as review from "./acts/review.js";
import { zoomBy } from "./views/image_pointer.js";
import * as span from "./state/marked_frames.js";
import { toggleWhole } from "./acts/tags.js";

/** @typedef {import("../keys/keymap.js").Binding} Binding */
/**
 * `brief`: text in the strip below the timeline; without it, a binding is only listed in the help.
 * @typedef {Binding & {brief?: string}} LabelBinding
 */

const STEP_M = 0.1,
  FAR_M = 1,
  TURN_DEG = 1,
  FAR_DEG = 10;

/**
 * @param {string} keys
 * @param {string} shown
 * @param {string} words
 * @param {() => unknown} act
 * @param {string} [brief]
 * @returns {LabelBinding}
 */
const key = (keys, shown, words, act, brief) => ({ keys: keys.split(" "), shown, words, act, brief, isOn });

/**
 * Active while a track is selected; otherwise arrow keys step through frames as usual.
 * @param {LabelBinding} binding
 * @returns {LabelBinding}
 */
const selected = (binding) => ({
  ...binding,
  isOn: () => isOn() && get("track") !== null && !["shape", "path"].includes(get("labeling")?.tool ?? ""),
});

/**
 * Active while a tool is on.
 * @param {import("../core/store.js").Labeling["tool"]} tool
 * @param {LabelBinding} binding
 * @returns {LabelBinding}
 */
const during = (tool, binding) => ({ ...binding, isOn: () => isOn() && get("labeling")?.tool === tool });

/** Active during review. @param {LabelBinding} binding @returns {LabelBinding} */
const reviewing = (binding) => ({ ...binding, isOn: review.isReviewing });

/** Keys that start a tool with arrow keys. */
const BEGINS = { shape: "Shift G", path: "Shift P" };

/**
 * Bindings for the four arrow keys, with and without Shift.
 * @param {"shape"|"path"} tool
 * @param {string} words
 * @param {(right: number, up: number, isShift: boolean) => unknown} act
 * @returns {LabelBinding[]}
 */
const arrows = (tool, words, act) =>
  /** @type {[string, number, number][]} */ ([
    ["Left", -1, 0],
    ["Right", 1, 0],
    ["Up", 0, 1],
    ["Down", 0, -1],
  ]).flatMap(([name, right, up]) => [
    during(
      tool,
      key(`Arrow${name}`, name === "Left" ? `${BEGINS[tool]}, ← → ↑ ↓` : name, name === "Left" ? words : "", () =>
        act(right, up, false),
      ),
    ),
    during(
      tool,
      key(`Shift+Arrow${name}`, `Shift ${name}`, "", () => act(right, up, true)),
    ),
  ]);

/**
 * A pair of bindings that make the cuboid larger and smaller.
 * @param {string} prefix
 * @param {string} shown
 * @param {[string, string]} names
 * @param {0|1|2} axis
 * @param {string} words
 * @returns {LabelBinding[]}
 */
const sizes = (prefix, shown, [more, less], axis, words) => [
  selected(key(prefix + more, shown, words, () => commands.grow(axis, STEP_M))),
  selected(key(prefix + less, `${shown.split(" ")[0]} ${less}`, "", () => commands.grow(axis, -STEP_M))),
];

/**
 * A pair of bindings, the second with Shift for the other direction.
 * @param {string} letter
 * @param {string} words
 * @param {(direction: 1|-1) => unknown} act
 * @param {string} [brief]
 * @returns {LabelBinding[]}
 */
const pair = (letter, words, act, brief) => [
  key(letter.toLowerCase(), letter, words, () => act(1), brief),
  key(`Shift+${letter}`, `Shift ${letter}`, words.replace(/^next/, "previous"), () => act(-1)),
];

/** @returns {{mode: string, title: string, bindings: LabelBinding[]}[]} */
export const labelKeys = () => [
  {
    mode: "labeling",
    title: "Labeling: review",
    bindings: [
      key("Shift+R", "Shift R", "review labels made by others", review.toggleReview),
      reviewing(key("a", "Shift R, A", "in review: approve and go to next", review.reviewOk)),
      reviewing(key("r", "Shift R, R", "in review: send back with a comment and go to next", review.sendBack)),
      reviewing(key("n", "Shift R, N", "in review: skip", () => review.nextUnreviewed(1))),
      reviewing(key("Shift+N", "Shift R, Shift N", "in review: previous", () => review.nextUnreviewed(-1))),
      key("h", "H", "send the selected track or the lead back with a comment", review.sendBack),
      key("Shift+H", "Shift H", "approve", review.reviewOk),
      ...pair("Y", "next label sent back", (d) => commands.goTo("sent_back", d)),
    ],
  },
  {
    mode: "labeling",
    title: "Labeling: proposals",
    bindings: [
      key("p", "P", "propose labels from the pipeline", commands.propose, "propose"),
      key("a", "A", "accept the selected track or the lead", () => commands.judge("accept"), "accept"),
      key("Shift+A", "Shift A", "accept all in this frame", commands.acceptHere),
      key("r", "R", "reject the selected track or the lead", () => commands.judge("reject"), "reject"),
      ...pair("N", "next unlabelled frame", (d) => commands.goTo("unlabelled", d), "next unlabelled"),
      ...pair(
        "V",
        "next disagreement between labels and pipeline",
        (d) => commands.goTo("disagreement", d),
        "next disagreement",
      ),
      key("Shift+M", "Shift M", "next queued frame", () => commands.goTo("asked", 1)),
      ...pair("B", "next proposal", (d) => commands.goTo("proposed", d), "next proposal"),
    ],
  },
  {
    mode: "labeling",
    title: "Labeling: lead",
    bindings: [
      key("i", "I", "lead starts here", span.begin, "lead from"),
      key("o", "O", "lead ends here", span.end, "to"),
      key(
        "[",
        "[",
        "move the nearest range start here (or drag it on the timeline)",
        () => bringHere("after"),
        "start here",
      ),
      key("]", "]", "move the nearest range end here", () => bringHere("before"), "end here"),
      key(
        "c",
        "C",
        "set the selected track as lead",
        () =>
          get("track") === null
            ? commands.say("Select a label first")
            : span.paint(/** @type {number} */ (get("track"))),
        "set lead",
      ),
      ...[..."123456789"].map((digit) =>
        key(digit, digit === "1" ? "1–9" : digit, digit === "1" ? "set the track with that number as lead" : "", () =>
          span.type(digit),
        ),
      ),
      key("0", "0", "no lead", () => span.type("0"), "none"),
      key("u", "U", "lead unclear", () => span.paint("unknown"), "unclear"),
      key("Shift+U", "Shift U", "clear the lead label", span.clear),
    ],
  },
  {
    mode: "labeling",
    title: "Labeling: shapes",
    bindings: [
      key(">", ">", "zoom into the image at the selected label (or wheel, pinch)", () => zoomBy(1.6), "zoom in"),
      key("<", "<", "zoom out", () => zoomBy(1 / 1.6)),
      key(".", ".", "next label in this frame", () => commands.selectNext(1), "next label"),
      key(",", ",", "previous label", () => commands.selectNext(-1)),
      during(
        "shape",
        key(
          "g",
          "Shift G, G",
          "place a cuboid for the selected label in the path ahead; adjust with arrows, Q and E",
          byKeys.cuboidAhead,
        ),
      ),
      key("g", "G", "new label: drag in the plan, drag or click in the image, or Enter", () => setTool("new"), "new"),
      key("Shift+G", "Shift G", "draw the selected track's shape", () => setTool("shape")),
      selected(key("ArrowUp", "↑", "move forward 0.1 m; Shift: 1 m", () => commands.nudge(STEP_M, 0))),
      selected(key("ArrowDown", "↓", "move back", () => commands.nudge(-STEP_M, 0))),
      selected(key("ArrowLeft", "←", "move left", () => commands.nudge(0, STEP_M))),
      selected(key("ArrowRight", "→", "move right", () => commands.nudge(0, -STEP_M))),
      selected(key("Shift+ArrowUp", "Shift ↑", "", () => commands.nudge(FAR_M, 0))),
      selected(key("Shift+ArrowDown", "Shift ↓", "", () => commands.nudge(-FAR_M, 0))),
      selected(key("Shift+ArrowLeft", "Shift ←", "", () => commands.nudge(0, FAR_M))),
      selected(key("Shift+ArrowRight", "Shift →", "", () => commands.nudge(0, -FAR_M))),
      selected(key("PageUp", "Page ↑", "move up 0.1 m", () => commands.nudge(0, 0, STEP_M))),
      selected(key("PageDown", "Page ↓", "move down", () => commands.nudge(0, 0, -STEP_M))),
      ...sizes("Ctrl+Arrow", "Ctrl ↑ ↓", ["Up", "Down"], 0, "longer or shorter by 0.1 m; the near side stays"),
      ...sizes("Ctrl+Arrow", "Ctrl → ←", ["Right", "Left"], 1, "wider or narrower"),
      ...sizes("Shift+Page", "Shift Page ↑ ↓", ["Up", "Down"], 2, "higher or lower; the bottom stays"),
      key("q", "Q", "rotate 1° left; Shift: 10°", () => commands.turn(TURN_DEG)),
      key("e", "E", "rotate 1° right; Shift: 10°", () => commands.turn(-TURN_DEG)),
      key("Shift+Q", "Shift Q", "", () => commands.turn(FAR_DEG)),
      key("Shift+E", "Shift E", "", () => commands.turn(-FAR_DEG)),
      key("Shift+X", "Shift X", "reverse the track: swap front and rear", commands.flip, "reverse"),
      key("s", "S", "fit the cuboid to the points", commands.snap, "snap"),
      key("Shift+S", "Shift S", "make the image box follow the cuboid again", commands.boxFollows),
      key("Shift+C", "Shift C", "extend the track both ways", () => commands.propagate("both"), "extend"),
      key("w", "W", "apply this size to the whole track", commands.sizeAlong, "apply size"),
      key("k", "K", "set keyframe", commands.keyframe, "keyframe"),
      key("Shift+K", "Shift K", "remove keyframe", commands.dropKeyframe),
      key("Delete Backspace", "Del", "remove from this frame or the marked frames", commands.notHere, "remove here"),
      key("Shift+Delete Shift+Backspace", "Shift Del", "delete the track", commands.removeTrack),
      ...pair("T", "next class", commands.nextClass, "class"),
      key("Shift+P", "Shift P", "draw the ego path: drag along its centre in the plan", () => setTool("path")),
      key("x", "X", "split the track from this frame on", commands.splitHere, "split"),
      key("m", "M", "merge with another label", commands.merge, "merge"),
      during(
        "new",
        key("Enter", "G, Enter", "place a new label in the path ahead; adjust with arrows, Q and E", byKeys.placeAhead),
      ),
      during(
        "merge",
        key("Enter", "M, ., Enter", "merge with the label selected with .", () =>
          commands.mergeWith(get("track") ?? -1),
        ),
      ),
      during("shape", key("Enter", "Shift G, Enter", "add an image box around the selected label", byKeys.boxAround)),
      ...arrows("shape", "move the image box; Shift: its right and bottom edges", (right, up, isSize) =>
        byKeys.changeBox(right, -up, isSize),
      ),
      during("path", key("Enter", "Shift P, Enter", "keep the drawn path, or the pipeline's", byKeys.keepPath)),
      ...arrows("path", "bend, lengthen or shorten the path; Shift: move it", (right, up, isWhole) =>
        right ? byKeys.bendPath(-right, isWhole) : byKeys.lengthenPath(up > 0 ? 1 : -1),
      ),
    ],
  },
  {
    mode: "labeling",
    title: "Labeling: frames",
    bindings: [
      key("f", "F", "next frame; Shift: forward 10", () => playback({ step: 1 }), "next frame"),
      key("d", "D", "previous frame; Shift: back 10", () => playback({ step: -1 }), "back"),
      key("Shift+F", "Shift F", "", () => playback({ step: 10 })),
      key("Shift+D", "Shift D", "", () => playback({ step: -10 })),
      key(
        "Shift+W",
        "Shift W",
        "mark this frame or the marked frames (I, O) as fully labelled; again to undo",
        toggleWhole,
        "all labelled",
      ),
      key("z", "Z", "show or hide pipeline objects", toggleObjects, "pipeline"),
      {
        ...key("Enter", "Enter", "confirm the typed number", () => span.enter()),
        isOn: () => isOn() && Boolean(get("marked")?.typed),
      },
      {
        ...key("Escape", "Esc", "cancel", () => cancel()),
        isOn: () =>
          isOn() &&
          (get("trimmed") !== null ||
            get("labeling")?.tool !== null ||
            get("marked") !== null ||
            get("track") !== null ||
            review.isReviewing()),
      },
    ],
  },
];
