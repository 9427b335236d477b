/** Keys of the labeling mode. They go before the page's own while it is on. */
import { playback } from "../core/api.js";
import { get } from "../core/store.js";
import * as byKeys from "./acts/keyboard_drawing.js";
import * as commands from "./acts/commands.js";
import { bringHere } from "./acts/range_ends.js";
import { cancel, isOn, setTool, toggleObjects } from "./state/mode.js";
import * as review from "./acts/review.js";
import * as span from "./state/marked_frames.js";
import { toggleWhole } from "./acts/tags.js";

/** @typedef {import("../keys/keymap.js").Binding} Binding */
/**
 * `brief`: the words of the strip below the timeline; what has none is only in the help.
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
 * Arrows move the selected cuboid; with none they go through the frames, as without the mode.
 * @param {LabelBinding} binding
 * @returns {LabelBinding}
 */
const selected = (binding) => ({
  ...binding,
  isOn: () => isOn() && get("track") !== null && !["shape", "path"].includes(get("labeling")?.tool ?? ""),
});

/**
 * While something is to be drawn.
 * @param {import("../core/store.js").Labeling["tool"]} tool
 * @param {LabelBinding} binding
 * @returns {LabelBinding}
 */
const during = (tool, binding) => ({ ...binding, isOn: () => isOn() && get("labeling")?.tool === tool });

/** While others' labels are looked through. @param {LabelBinding} binding @returns {LabelBinding} */
const reviewing = (binding) => ({ ...binding, isOn: review.isReviewing });

/** After which keys the arrows are a tool's. */
const BEGINS = { shape: "Shift G", path: "Shift P" };

/**
 * The four arrows, each alone and with Shift.
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
 * A pair of keys, the second with Shift for the other direction.
 * @param {string} letter
 * @param {string} words
 * @param {(direction: 1|-1) => unknown} act
 * @param {string} [brief]
 * @returns {LabelBinding[]}
 */
const pair = (letter, words, act, brief) => [
  key(letter.toLowerCase(), letter, words, () => act(1), brief),
  key(`Shift+${letter}`, `Shift ${letter}`, `${words}, backwards`, () => act(-1)),
];

/** @returns {{mode: string, title: string, bindings: LabelBinding[]}[]} */
export const labelKeys = () => [
  {
    mode: "labeling",
    title: "Labeling: review",
    bindings: [
      key("Shift+R", "Shift R", "review: go through what others stand behind", review.toggleReview),
      reviewing(key("a", "Shift R, A", "in a review: it is right, and the next", review.reviewOk)),
      reviewing(key("r", "Shift R, R", "in a review: send it back with a comment, and the next", review.sendBack)),
      reviewing(key("n", "Shift R, N", "in a review: leave it, the next", () => review.nextUnreviewed(1))),
      reviewing(key("Shift+N", "Shift R, Shift N", "in a review: the one before", () => review.nextUnreviewed(-1))),
      key("h", "H", "send the selected track, or who leads here, back with a comment", review.sendBack),
      key("Shift+H", "Shift H", "reviewed: it is right", review.reviewOk),
      ...pair("Y", "next label that was sent back", (d) => commands.goTo("sent_back", d)),
    ],
  },
  {
    mode: "labeling",
    title: "Labeling: proposals",
    bindings: [
      key("p", "P", "take the pipeline's output as proposals", commands.propose, "propose"),
      key("a", "A", "accept the selected track, or who leads here", () => commands.judge("accept"), "accept"),
      key("Shift+A", "Shift A", "accept everything in this frame", commands.acceptHere),
      key("r", "R", "reject it", () => commands.judge("reject"), "reject"),
      ...pair(
        "N",
        "next frame in which something is unlabelled",
        (d) => commands.goTo("unlabelled", d),
        "next unlabelled",
      ),
      ...pair(
        "V",
        "next disagreement of labels and pipeline",
        (d) => commands.goTo("disagreement", d),
        "next disagreement",
      ),
      ...pair("B", "next proposal", (d) => commands.goTo("proposed", d), "next proposal"),
    ],
  },
  {
    mode: "labeling",
    title: "Labeling: who leads",
    bindings: [
      key("i", "I", "the lead begins here", span.begin, "lead from"),
      key("o", "O", "the lead ends here", span.end, "to"),
      key(
        "[",
        "[",
        "the nearest beginning of a range comes here (or drag it on the timeline)",
        () => bringHere("after"),
        "begins here",
      ),
      key("]", "]", "the nearest end of a range comes here", () => bringHere("before"), "ends here"),
      key(
        "c",
        "C",
        "the selected track leads",
        () =>
          get("track") === null
            ? commands.say("Select a label first")
            : span.paint(/** @type {number} */ (get("track"))),
        "is the lead",
      ),
      ...[..."123456789"].map((digit) =>
        key(digit, digit === "1" ? "1–9" : digit, digit === "1" ? "the track of that number leads" : "", () =>
          span.type(digit),
        ),
      ),
      key("0", "0", "nobody leads", () => span.type("0"), "none"),
      key("u", "U", "one can't tell who leads", () => span.paint("unknown"), "can't tell"),
      key("Shift+U", "Shift U", "take back who leads", span.clear),
    ],
  },
  {
    mode: "labeling",
    title: "Labeling: shapes",
    bindings: [
      key(".", ".", "next label in this frame", () => commands.selectNext(1), "next label"),
      key(",", ",", "label before", () => commands.selectNext(-1)),
      during(
        "shape",
        key(
          "g",
          "Shift G, G",
          "a cuboid for the selected label, in our path ahead; arrows, Q and E put it right",
          byKeys.cuboidAhead,
        ),
      ),
      key("g", "G", "new label: drag in the plan, drag or click in the picture, or Enter", () => setTool("new"), "new"),
      key("Shift+G", "Shift G", "draw the selected track's shape here", () => setTool("shape")),
      selected(key("ArrowUp", "↑", "move it 0.1 m; Shift: 1 m", () => commands.nudge(STEP_M, 0))),
      selected(key("ArrowDown", "↓", "back", () => commands.nudge(-STEP_M, 0))),
      selected(key("ArrowLeft", "←", "to the left", () => commands.nudge(0, STEP_M))),
      selected(key("ArrowRight", "→", "to the right", () => commands.nudge(0, -STEP_M))),
      selected(key("Shift+ArrowUp", "Shift ↑", "", () => commands.nudge(FAR_M, 0))),
      selected(key("Shift+ArrowDown", "Shift ↓", "", () => commands.nudge(-FAR_M, 0))),
      selected(key("Shift+ArrowLeft", "Shift ←", "", () => commands.nudge(0, FAR_M))),
      selected(key("Shift+ArrowRight", "Shift →", "", () => commands.nudge(0, -FAR_M))),
      key("q", "Q", "turn it 1° to the left; Shift: 10°", () => commands.turn(TURN_DEG)),
      key("e", "E", "turn it 1° to the right; Shift: 10°", () => commands.turn(-TURN_DEG)),
      key("Shift+Q", "Shift Q", "", () => commands.turn(FAR_DEG)),
      key("Shift+E", "Shift E", "", () => commands.turn(-FAR_DEG)),
      key("s", "S", "snap it to its points", commands.snap, "snap"),
      key("w", "W", "this size along the whole track", commands.sizeAlong, "size along"),
      key("k", "K", "keyframe: it is right here", commands.keyframe, "keyframe"),
      key("Shift+K", "Shift K", "no keyframe here", commands.dropKeyframe),
      key(
        "Delete Backspace",
        "Del",
        "it is not there (in this frame, or in the marked ones)",
        commands.notHere,
        "not here",
      ),
      key("Shift+Delete Shift+Backspace", "Shift Del", "remove the track", commands.removeTrack),
      ...pair("T", "next class", commands.nextClass, "class"),
      key("Shift+P", "Shift P", "draw our path: drag along its middle in the plan", () => setTool("path")),
      key("x", "X", "split: from this frame on it is another", commands.splitHere, "split"),
      key("m", "M", "merge with the label that is pressed or selected next", commands.merge, "merge"),
      during(
        "new",
        key(
          "Enter",
          "G, Enter",
          "a new label of the class in the bar, in our path ahead; arrows, Q and E put it right",
          byKeys.placeAhead,
        ),
      ),
      during(
        "merge",
        key("Enter", "M, ., Enter", "merge with the label that was selected by .", () =>
          commands.mergeWith(get("track") ?? -1),
        ),
      ),
      during(
        "shape",
        key("Enter", "Shift G, Enter", "a box around the selected label in the picture", byKeys.boxAround),
      ),
      ...arrows("shape", "move the box in the picture; Shift: its right and lower side", (right, up, isSize) =>
        byKeys.changeBox(right, -up, isSize),
      ),
      during("path", key("Enter", "Shift P, Enter", "keep the path as drawn, or the pipeline's", byKeys.keepPath)),
      ...arrows(
        "path",
        "bend the path's far end, make it longer or shorter; Shift: move all of it",
        (right, up, isWhole) => (right ? byKeys.bendPath(-right, isWhole) : byKeys.lengthenPath(up > 0 ? 1 : -1)),
      ),
    ],
  },
  {
    mode: "labeling",
    title: "Labeling: frames",
    bindings: [
      key("f", "F", "one frame on; Shift: ten", () => playback({ step: 1 }), "frame on"),
      key("d", "D", "one frame back; Shift: ten", () => playback({ step: -1 }), "back"),
      key("Shift+F", "Shift F", "", () => playback({ step: 10 })),
      key("Shift+D", "Shift D", "", () => playback({ step: -10 })),
      key(
        "Shift+W",
        "Shift W",
        "every vehicle is labelled: in the marked frames (I, O), or in this one; again: no more",
        toggleWhole,
        "all labelled",
      ),
      key("z", "Z", "the pipeline's objects too", toggleObjects, "pipeline"),
      {
        ...key("Enter", "Enter", "take the number that is typed", () => span.enter()),
        isOn: () => isOn() && Boolean(get("marked")?.typed),
      },
      {
        ...key("Escape", "Esc", "let go: a dragged end, tool, marked frames, selection, review", () => cancel()),
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
