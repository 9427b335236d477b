/** The page's state. Panes subscribe to the keys that they draw. */

/**
 * Values are null until first set.
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
 * @property {number} scrub the requested frame, until it is shown
 * @property {{first: number, last: number}} clip what is marked for export
 * @property {import("../workspace/panes.js").Layout} layout
 * @property {{on: boolean, blend: number, edges: boolean, regions: boolean}} align alignment mode
 * @property {import("../align/pairs.js").Pairs} pairs of LiDAR points and pixels, picked by hand
 * @property {import("../align/pairs.js").Picked} pairHover what a press would pick
 * @property {number} lanes how many lanes the timeline has
 * @property {Labeling} labeling state of the labeling mode
 * @property {import("../labeling/state/labels.js").Labels} labels
 * @property {number} labelFrames incremented when labels of some frames have arrived
 * @property {import("../labeling/state/classes.js").ClassList} classes what people choose from
 * @property {number} track id of the selected label
 * @property {import("../labeling/state/draft.js").Draft} draft a label being edited or saved
 * @property {import("../labeling/state/marked_frames.js").Marked} marked frames marked for labeling
 * @property {import("../labeling/acts/range_ends.js").Trimmed} trimmed a lead range being resized
 * @property {import("../labeling/acts/queue.js").Saving} saving
 * @property {import("../labeling/views/three.js").Dragged} dragged the selected label being dragged in the 3D view
 * @property {string} person name of the annotator, once known
 * @property {number} keys incremented when keys were changed
 * @property {import("../labeling/state/undo_state.js").Steps} steps
 * @property {number} threshold how sure a proposal must be to be shown, 0–1
 * @property {string} said status message of the labeling mode
 * @property {import("../labeling/bar/offer.js").Offer} offer a next step that fits it
 * @property {import("../labeling/views/projection.js").Projected} projected
 * @property {{left: import("./types.js").Point2[], right: import("./types.js").Point2[]}} drawnPath a path being drawn
 */
/**
 * @typedef
 *   {{on: boolean, tool: null|"new"|"shape"|"merge"|"path", from: number|null, hasObjects: boolean, review: boolean,
 *   follows: boolean, item: {kind: import("../labeling/state/types.js").ItemKind, id: number}|null}}
 *   Labeling tool: what the next drag or click does; from: the track to merge; hasObjects: whether pipeline objects are
 *   drawn; review: whether review is on; follows: the shared playhead; item: the label under review
 */
/** @typedef {keyof Values} Key */

/** @type {Partial<Values>} */
const values = {};
/** @type {Map<Key, Set<(value: any) => void>>} */
const listeners = new Map();
/** Callbacks for the next animation frame, and for the one after. @type {Set<() => void>} */
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

/** Like `on`, but at most once per animation frame, for drawing. @param {Key[]} keys @param {() => void} draw */
export function paint(keys, draw) {
  const invalidate = painter(draw);
  on(keys, invalidate);
  return invalidate;
}

/**
 * Like `paint`, but one animation frame later, for text-heavy parts such as tables, whose layout takes longer than
 * drawing the views. During playback, together with everything else.
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

/** Returns a function that schedules `draw` for the next animation frame. @param {() => void} draw */
export function painter(draw) {
  return () => {
    due.add(draw);
    ask();
  };
}

/** Draw now instead of at the next animation frame. Does nothing while the page is hidden. */
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
      reportError(error); // an error in one view must not stop the others
    }
  }
}

/** Select an object in all views; selecting it again deselects it. @param {number|null} id */
export function select(id) {
  set("selection", id === null || id === get("selection") ? null : id);
}
