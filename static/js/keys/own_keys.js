/** Keys that a person has changed, stored in this browser under that person's name. */
import { memory } from "../core/dom.js";
import { get, set } from "../core/store.js";

/** @typedef {import("./keymap.js").Binding} Binding */
/** @typedef {import("./keymap.js").Group} Group */

/** The person whose keys these are; "" without a name. */
const owner = () => get("person") || memory.read("person", "");
const place = () => `keys ${owner()}`;

/** Changed keys, by their id in the keymap. @returns {Record<string, string>} */
const changed = () => memory.read(place(), /** @type {Record<string, string>} */ ({}));

/** Keys of a mode and of the page are kept separate. @param {Group} group @param {Binding} binding */
const idOf = ({ mode }, { keys }) => `${mode ?? "page"} ${keys[0]}`;

/** A key as shown to the user. @param {string} name */
export const shownAs = (name) =>
  name
    .split("+")
    .map((part) => (part.length === 1 ? part.toUpperCase() : part.replace(/^Arrow/, "")))
    .join(" ");

/** The keymap with a person's own keys. @param {Group[]} groups @returns {Group[]} */
export function withOwn(groups) {
  const own = changed();
  return groups.map((group) => ({
    ...group,
    bindings: group.bindings.map((binding) => {
      const id = idOf(group, binding),
        name = own[id];
      return name ? { ...binding, id, keys: [name], shown: shownAs(name), isOwn: true } : { ...binding, id };
    }),
  }));
}

/**
 * Assign another key to a binding. Returns the words of the binding that already uses the key, or null.
 * @param {Group[]} groups with own keys
 * @param {Group} group
 * @param {Binding} binding
 * @param {string} name
 * @returns {string|null}
 */
export function change(groups, group, binding, name) {
  const taken = groups
    .filter(({ mode }) => mode === group.mode)
    .flatMap(({ bindings }) => bindings)
    .find(({ keys, id }) => keys.includes(name) && id !== binding.id);
  if (taken) return taken.words || taken.shown;
  memory.write(place(), { ...changed(), [binding.id ?? ""]: name });
  set("keys", (get("keys") ?? 0) + 1);
  return null;
}

/** Restore all default keys. */
export function reset() {
  memory.write(place(), {});
  set("keys", (get("keys") ?? 0) + 1);
}
