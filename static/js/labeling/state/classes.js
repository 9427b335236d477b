/** Classes and attributes that people choose from: the project's list, see pipeline/labels/classes.yaml. */
import { request } from "../../core/api.js";
import { el } from "../../core/dom.js";
import { get, on, set } from "../../core/store.js";

/** @typedef {import("./types.js").LabelClass} LabelClass */
/** @typedef {import("./types.js").AttributeKind} AttributeKind */
/** @typedef {{classes: LabelClass[], attributes: AttributeKind[]}} ClassList */

const FIRST = "car";

/** Names in the order in which people choose. */
export const classNames = () => (get("classes")?.classes ?? []).map(({ name }) => name);
export const attributes = () => get("classes")?.attributes ?? [];
export const firstClass = () => classNames()[0] ?? FIRST;

/** Length, width, height; null where there is none. @param {string} label @returns {[number, number, number]|null} */
export const usualSize = (label) => get("classes")?.classes.find(({ name }) => name === label)?.size ?? null;

/** Asked for when somebody first labels a recording, because its project may have classes of its own. */
export function setUp() {
  /** @type {string|null} */
  let askedFor = null;
  const ask = async () => {
    const drive = get("labels")?.drive ?? "";
    if (askedFor === drive || !get("labeling")?.on) return;
    askedFor = drive;
    const found = await request("api/labels/classes").catch(() => null);
    if (found) set("classes", found);
    else if (askedFor === drive) askedFor = null;
  };
  on(["labeling", "labels"], ask);
  ask();
}

/** Fill a selection list with the classes; sub-classes say what they are a kind of. @param {HTMLSelectElement} list */
export function fill(list) {
  const { value } = list;
  list.replaceChildren(
    ...(get("classes")?.classes ?? []).map(({ name, of }) =>
      el("option", { value: name, textContent: of ? `${name} (${of})` : name }),
    ),
  );
  if (value) list.value = value;
}
