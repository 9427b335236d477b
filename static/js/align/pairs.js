/**
 * Pairs of a LiDAR point and the pixel where it belongs, picked by hand, and the alignment that the server fits to
 * them. Pairs of several frames count together. They stay in this page, and change nothing until their fit is applied.
 */
import { newestOnly, playback, request } from "../core/api.js";
import { get, on, set } from "../core/store.js";
import { change, settled } from "../panels/params.js";
import { fitsPosition, model, positionSwitch } from "./fit.js";
import { save as saveVersion } from "./versions.js";

/** @typedef {import("./types.js").PairsAnswer} PairsAnswer */
/** @typedef {"point"|"cluster"} PairKind */
/**
 * @typedef {object} Picked a LiDAR point, or where the vehicle of a cluster stands on the road
 * @property {PairKind} kind
 * @property {[number, number, number]} point ego frame, metres
 * @property {[number, number][]} dots its points, pixels of the original image
 * @property {string} name of the frame
 * @property {string} frame that it was picked in: recording and number
 */
/** @typedef {Picked & {pixel: [number, number]}} Pair pixel: of the original image */
/**
 * @typedef {object} Pairs
 * @property {boolean} isOn
 * @property {PairKind} kind what the next press picks
 * @property {Pair[]} list
 * @property {Picked|null} picked waits for its pixel
 * @property {PairsAnswer|null} answer of this list
 * @property {string} said why the last press did nothing; empty otherwise
 */

/** @type {Pairs} */
const NONE = { isOn: false, kind: "point", list: [], picked: null, answer: null, said: "" };
/** Earlier lists, for undo. @type {Pair[][]} */
let history = [];
/** Whether the last thing done was to the pairs, so that Ctrl Z means them. */
let isLast = false;
/** @type {string|null|undefined} */
let knownUri;
/** Alignment parameters that the answer is for. */
let knownValues = "";

export const pairs = () => get("pairs") ?? NONE;
export const isPairing = () => pairs().isOn;
export const isPicked = () => isPairing() && pairs().picked !== null;
export const isUndoNext = () => isPairing() && isLast && history.length > 0;
export const hasHistory = () => history.length > 0;

/** @param {Partial<Pairs>} changes */
const put = (changes) => set("pairs", { ...pairs(), ...changes });

export function setUp() {
  set("pairs", NONE);
  positionSwitch.addEventListener("change", refit);
  on(["params"], () => {
    const { values } = get("params") ?? { values: {} };
    const alignment = JSON.stringify(Object.entries(values).filter(([name]) => name.startsWith("alignment.")));
    if (alignment === knownValues) return;
    if (knownValues) isLast = false; // the parameters were changed after the pairs; the first ones are no change
    knownValues = alignment;
    refit();
  });
  on(["state"], () => {
    const uri = get("state")?.uri;
    if (uri === knownUri) return;
    knownUri = uri;
    forget(); // another camera
  });
  on(["frame"], () => {
    const { picked } = pairs();
    if (picked && picked.frame !== frameKey())
      put({ picked: null, said: "The frame has changed: press the point again." });
  });
}

/** The shown frame. */
export const frameKey = () => `${get("frame")?.state.uri} ${get("frame")?.state.index}`;

/** @param {boolean} isOn */
export function toggle(isOn) {
  if (isOn === isPairing()) return;
  if (isOn && get("state")?.playing) playback({ playing: false }); // point and pixel belong to one frame
  put({ isOn, picked: null, said: "" });
  if (isOn) refit();
}

/** @param {PairKind} kind */
export const setKind = (kind) => put({ kind, picked: null, said: "" });

/** @param {Picked|null} picked null if there is none where it was pressed */
export function pick(picked) {
  const missing =
    pairs().kind === "cluster"
      ? "No object with LiDAR points here: press one of its points."
      : "No LiDAR point here: press nearer to one.";
  put({ picked, said: picked ? "" : missing });
}

/** Complete the pair. @param {[number, number]} pixel */
export function place(pixel) {
  const { picked, list } = pairs();
  if (picked) alter([...list, { ...picked, pixel }]);
}

/** Let go of the picked point. */
export const release = () => put({ picked: null, said: "" });

/** @param {Pair} pair */
export const remove = (pair) => alter(pairs().list.filter((each) => each !== pair));
export const clear = () => alter([]);

/** @param {Pair[]} list */
function alter(list) {
  history.push(pairs().list);
  isLast = true;
  put({ list, picked: null, answer: null, said: "" });
  refit();
}

/** Undo the last change of the pairs. */
export function undo() {
  const list = history.pop();
  if (!list) return;
  put({ list, picked: null, answer: null, said: "" });
  refit();
}

function forget() {
  history = [];
  put({ list: [], picked: null, answer: null, said: "" });
}

/** Use the fitted alignment: one step that can be undone. */
export async function apply() {
  const { answer, list } = pairs();
  if (!answer?.fit) return;
  change(/** @type {any} */ (answer.fit.changes), true);
  await saveVersion(`${list.length} pairs picked by hand`);
}

const ask = newestOnly(async () => {
  await settled(); // the server answers for its parameters
  const { list } = pairs();
  const body = {
    model: model(),
    offset: fitsPosition(),
    pairs: list.map(({ kind, point, pixel }) => ({ kind, point, pixel })),
  };
  const found = /** @type {PairsAnswer|Error} */ (
    await request("api/alignment/pairs", "POST", body).catch((error) => error)
  );
  if (list !== pairs().list) return; // the newer list is asked for next
  if (found instanceof Error) put({ answer: null, said: found.message });
  else put({ answer: found });
});

function refit() {
  if (isPairing() && pairs().list.length) ask(undefined);
}
