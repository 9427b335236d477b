/** The page's only state. A pane subscribes to the keys it draws; whoever learns something sets a key. */

/**
 * Null until first set.
 * @typedef {object} Values
 * @property {import("./types.js").State} state
 * @property {import("./types.js").Frame} frame
 * @property {number} selection id of the object selected everywhere
 * @property {Record<string, boolean>} layers
 * @property {Record<"camera"|"plan", import("../views/drawing/point_colors.js").ColorBy>} colorBy
 * @property {boolean} taping whether a drag measures
 * @property {import("../views/measuring_tape.js").Tape} tape what was measured
 * @property {{status: "live"|"lost", since: number}} link
 * @property {import("./types.js").ParamsAnswer} params
 * @property {string} theme
 * @property {import("../drive/types.js").Drive} drive the whole recording, as the timeline shows it
 * @property {import("../drive/types.js").ObjectCurve} curve the selected object over the recording
 * @property {number} scrub the frame asked for and not shown yet
 * @property {{first: number, last: number}} clip what is marked for export
 * @property {import("../workspace/panes.js").Layout} layout
 * @property {{on: boolean, blend: number, edges: boolean}} align alignment mode
 * @property {number} lanes how many lanes the timeline has
 * @property {Labeling} labeling the mode in which people label
 * @property {import("../labeling/state/labels.js").Labels} labels
 * @property {number} labelFrames grows when what is labelled in some frames has come
 * @property {number} track id of the selected label
 * @property {import("../labeling/state/draft.js").Draft} draft a label under a hand, or on its way to the server
 * @property {import("../labeling/state/marked_frames.js").Marked} marked the frames that a lead is painted over
 * @property {import("../labeling/acts/range_ends.js").Trimmed} trimmed a lead range whose end is under a hand
 * @property {import("../labeling/acts/queue.js").Saving} saving
 * @property {import("../labeling/views/three.js").Dragged} dragged the selected label under a hand in the 3D view
 * @property {string} person who labels, once it was said here
 * @property {import("../labeling/state/undo_state.js").Steps} steps
 * @property {string} said what the labeling mode has to say
 * @property {import("../labeling/views/projection.js").Projected} projected
 * @property {{left: import("./types.js").Point2[], right: import("./types.js").Point2[]}} drawnPath a path under a hand
 */
/**
 * @typedef
 *   {{on: boolean, tool: null|"new"|"shape"|"merge"|"path", from: number|null, hasObjects: boolean, review: boolean,
 *   item: {kind: import("../labeling/state/types.js").ItemKind, id: number}|null}}
 *   Labeling tool: what the next drag or click does; from: the track that is merged with another; hasObjects: whether
 *   the pipeline's objects are drawn; review: whether others' labels are looked through; item: which one now
 */
/** @typedef {keyof Values} Key */

/** @type {Partial<Values>} */
const values = {};
/** @type {Map<Key, Set<(value: any) => void>>} */
const listeners = new Map();
/** What is to be drawn: at the next turn of the screen, and one turn after that. @type {Set<() => void>} */
const due = new Set();
/** @type {Set<() => void>} */
const after = new Set();
let isAsked = false,
  hasWaited = false;

/** @template {Key} K @param {K} key @returns {Values[K]|null} */
export function get(key) {
  return /** @type {Values[K]|undefined} */ (values[key]) ?? null;
}

/** @template {Key} K @param {K} key @param {Values[K]|null} value */
export function set(key, value) {
  values[key] = /** @type {any} */ (value);
  for (const listener of listeners.get(key) ?? []) listener(value);
}

/** Call `listener` whenever one of the keys is set. @param {Key[]} keys @param {() => void} listener */
export function on(keys, listener) {
  for (const key of keys) {
    const held = listeners.get(key) ?? new Set();
    listeners.set(key, held.add(listener));
  }
}

/** Like `on`, at most once per painted frame: for what draws. @param {Key[]} keys @param {() => void} draw */
export function paint(keys, draw) {
  const invalidate = painter(draw);
  on(keys, invalidate);
  return invalidate;
}

/**
 * Like `paint`, one painted frame later: for what many words say, as a table does. Having those laid out takes longer
 * than the views take to draw, and nobody reads that fast. While a drive plays, with everything else.
 * @param {Key[]} keys
 * @param {() => void} draw
 */
export function paintAfter(keys, draw) {
  const invalidate = () => {
    after.add(draw);
    ask();
  };
  on(keys, invalidate);
  return invalidate;
}

/** A function that has `draw` run once before the next paint, however often it is called. @param {() => void} draw */
export function painter(draw) {
  return () => {
    due.add(draw);
    ask();
  };
}

/** Draw what is due without waiting for the screen's next turn, which then only has to show it. A page that nobody sees
 * waits until somebody does. */
export function drawNow() {
  if (!document.hidden) run(due);
}

function ask() {
  if (isAsked) return;
  isAsked = true;
  requestAnimationFrame(turn);
}

function turn() {
  isAsked = false;
  run(due);
  if (hasWaited || get("state")?.playing) run(after); // during playback, drawing everything at once costs less
  hasWaited = after.size > 0;
  if (hasWaited) ask();
}

/** @param {Set<() => void>} draws */
function run(draws) {
  const all = [...draws];
  draws.clear();
  for (const draw of all) {
    try {
      draw();
    } catch (error) {
      reportError(error); // one view that fails takes no other with it
    }
  }
}

/** Select an object everywhere; selecting it again takes the selection away. @param {number|null} id */
export function select(id) {
  set("selection", id === null || id === get("selection") ? null : id);
}
