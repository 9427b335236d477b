/** The page's only state. A pane subscribes to the keys it draws; whoever learns something sets a key. */

/** @typedef {"state"|"frame"|"selection"|"layers"|"link"|"params"|"theme"} Key */

const values = new Map();
/** @type {Map<Key, Set<(value: any) => void>>} */
const listeners = new Map();

/** @param {Key} key */
export function get(key) {
  return values.get(key) ?? null;
}

/** @param {Key} key @param {any} value */
export function set(key, value) {
  values.set(key, value);
  for (const listener of listeners.get(key) ?? []) listener(value);
}

/** Call `listener` whenever one of the keys is set. @param {Key[]} keys @param {() => void} listener */
export function on(keys, listener) {
  for (const key of keys) {
    if (!listeners.has(key)) listeners.set(key, new Set());
    listeners.get(key).add(listener);
  }
}

/** Like `on`, at most once per painted frame: for what draws. @param {Key[]} keys @param {() => void} draw */
export function paint(keys, draw) {
  const invalidate = painter(draw);
  on(keys, invalidate);
  return invalidate;
}

/** A function that has `draw` run once before the next paint, however often it is called. @param {() => void} draw */
export function painter(draw) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      draw();
    });
  };
}

/** Select an object everywhere; selecting it again takes the selection away. @param {number|null} id */
export function select(id) {
  set("selection", id === null || id === get("selection") ? null : id);
}
