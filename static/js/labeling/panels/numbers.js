/** Place, size and heading of the selected cuboid as numbers that can be typed. */
import { el } from "../../core/dom.js";
import { numberField, numberOf } from "../../core/number_field.js";
import { get, paint } from "../../core/store.js";
import { hold, presentOf, release } from "../state/draft.js";
import { chosen } from "../state/labels.js";

/** @typedef {import("../state/types.js").Cuboid} Cuboid */
/** @typedef {{name: string, title: string, least: number, most: number, of: (cuboid: Cuboid) => number,
 *   with: (cuboid: Cuboid, value: number) => Cuboid}} Field */

const DEG = 180 / Math.PI;
/** Of the arrow keys, metres or degrees. */
const STEP = 0.1;

/** @param {"center"|"size"} part @param {number} axis @param {string} name @param {string} title @returns {Field} */
const side = (part, axis, name, title) => ({
  name,
  title,
  least: part === "size" ? 0.1 : -1000,
  most: part === "size" ? 200 : 1000,
  of: (cuboid) => cuboid[part][axis],
  with: (cuboid, value) => ({
    ...cuboid,
    [part]: cuboid[part].map((each, place) => (place === axis ? value : each)),
  }),
});

/** @type {Field[]} */
const FIELDS = [
  side("center", 0, "x", "Middle, metres ahead"),
  side("center", 1, "y", "Middle, metres to the left"),
  side("center", 2, "z", "Middle, metres up"),
  side("size", 0, "l", "Length, metres"),
  side("size", 1, "w", "Width, metres"),
  side("size", 2, "h", "Height, metres"),
  {
    name: "yaw",
    title: "Heading, degrees to the left",
    least: -360,
    most: 360,
    of: ({ yaw_rad }) => yaw_rad * DEG,
    with: (cuboid, value) => ({ ...cuboid, yaw_rad: Math.atan2(Math.sin(value / DEG), Math.cos(value / DEG)) }),
  },
];

const inputs = FIELDS.map(({ name, title, least, most }) =>
  numberField({ label: title, least, most, step: STEP }, { name }),
);
export const node = el(
  "div",
  { class: "numbers" },
  ...FIELDS.map(({ name, title }, place) => el("label", { title }, el("span", { textContent: name }), inputs[place])),
);

export function setUp() {
  inputs.forEach((input, place) => {
    input.addEventListener("change", () => put(FIELDS[place], input));
    input.addEventListener("keydown", ({ key }) => (key === "Enter" || key === "Escape") && input.blur());
  });
  paint(["track", "labels", "labelFrames", "frame", "draft"], show);
}

function show() {
  const cuboid = presentOf(get("track") ?? null)?.cuboid ?? null;
  node.hidden = cuboid === null;
  FIELDS.forEach((field, place) => {
    if (cuboid && document.activeElement !== inputs[place]) inputs[place].value = field.of(cuboid).toFixed(2);
  });
}

/** @param {Field} field @param {HTMLInputElement} input */
function put(field, input) {
  const id = chosen()?.id ?? null,
    cuboid = presentOf(id)?.cuboid,
    typed = numberOf(input) ?? NaN;
  if (id === null || !cuboid || !(typed >= field.least && typed <= field.most)) return show();
  hold(id, { cuboid: field.with(cuboid, typed) });
  release();
}
