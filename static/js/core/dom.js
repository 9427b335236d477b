/** Small helpers to find, build and change elements. */

/**
 * The element that matches a selector. Throws if there is none, or it is of another type.
 * @template {Element} [T=HTMLElement]
 * @param {string} selector
 * @param {new () => T} [kind]
 * @param {ParentNode} [within]
 * @returns {T}
 */
export function $(selector, kind, within = document) {
  const found = within.querySelector(selector);
  if (!(found instanceof (kind ?? HTMLElement))) throw new Error(`the page has no ${selector}`);
  return /** @type {any} */ (found);
}

/** @typedef {Node|string|null|undefined} Child */
/**
 * Properties of an element, except `class`, `data` (dataset), `aria` (and role) and `style` (CSS custom properties).
 * @typedef {{class?: string, data?: Record<string, string|number>, aria?: Record<string, string|number>,
 *   style?: Record<string, string>, [property: string]: any}} Props
 */

/**
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag
 * @param {Props} props
 * @param {Child[]} children
 * @returns {HTMLElementTagNameMap[T]}
 */
export function el(tag, props = {}, ...children) {
  const node = document.createElement(tag);
  const { class: className, data, aria, style, ...rest } = props;
  if (className) node.className = className;
  for (const [key, value] of Object.entries(data ?? {})) node.dataset[key] = String(value);
  for (const [key, value] of Object.entries(aria ?? {}))
    node.setAttribute(key === "role" ? "role" : `aria-${key}`, String(value));
  for (const [key, value] of Object.entries(style ?? {})) node.style.setProperty(key, value);
  Object.assign(node, rest);
  node.append(.../** @type {(Node|string)[]} */ (children.filter((child) => child !== null && child !== undefined)));
  return node;
}

/**
 * Set text only if it differs: the table calls this hundreds of times a second.
 * @param {Node} node
 * @param {string} value
 */
export function text(node, value) {
  if (node.textContent !== value) node.textContent = value;
}

/** Set the title only if it differs. @param {HTMLElement} node @param {string} words */
export function entitle(node, words) {
  if (node.title !== words) node.title = words;
}

/** Set a data attribute only if it differs. @param {HTMLElement} node @param {string} name @param {string} value */
export function mark(node, name, value) {
  if (node.dataset[name] !== value) node.dataset[name] = value;
}

/** @type {WeakMap<Element, Map<string, any>>} */
const kept = new WeakMap();

/**
 * Keep one child of `parent` per item, in order. Children are updated rather than recreated, so that none is replaced
 * while it is being pressed.
 * @template T
 * @template {HTMLElement} N
 * @param {HTMLElement} parent
 * @param {T[]} items
 * @param {(item: T) => string} keyOf
 * @param {(item: T) => N} create
 * @param {(node: N, item: T) => void} update
 */
export function keyed(parent, items, keyOf, create, update) {
  const before = kept.get(parent) ?? new Map(),
    now = new Map();
  items.forEach((item, place) => {
    const key = keyOf(item),
      node = before.get(key) ?? create(item);
    now.set(key, node);
    update(node, item);
    if (parent.children[place] !== node) parent.insertBefore(node, parent.children[place] ?? null);
  });
  while (parent.children.length > items.length) parent.lastElementChild?.remove();
  kept.set(parent, now);
}

/** @param {Element} button @param {boolean} pressed */
export function press(button, pressed) {
  button.setAttribute("aria-pressed", String(pressed));
}

/**
 * The closest ancestor of an event's target that matches a selector.
 * @param {Event} event
 * @param {string} selector
 */
export function within(event, selector) {
  return event.target instanceof Element ? /** @type {HTMLElement|null} */ (event.target.closest(selector)) : null;
}

/** @param {HTMLCanvasElement} canvas @param {CanvasRenderingContext2DSettings} [settings] */
export function context(canvas, settings) {
  const ctx = canvas.getContext("2d", settings);
  if (!ctx) throw new Error("this browser does not support canvas");
  return ctx;
}

/** Values kept in a browser storage; without one, they are lost on reload. @param {() => Storage} storage */
const keptIn = (storage) => ({
  /** @template T @param {string} key @param {T} fallback @returns {T} */
  read(key, fallback) {
    try {
      return JSON.parse(storage().getItem(`cipv.${key}`) ?? "null") ?? fallback;
    } catch {
      return fallback;
    }
  },
  /** @param {string} key @param {unknown} value */
  write(key, value) {
    try {
      storage().setItem(`cipv.${key}`, JSON.stringify(value));
    } catch {
      // storage is disabled
    }
  },
});

/** Settings of this browser. */
export const memory = keptIn(() => localStorage);
/** State of this tab, restored after a reload. */
export const tabMemory = keptIn(() => sessionStorage);
/** Whether the page was reloaded, not opened. */
export const isReloaded = () =>
  performance.getEntriesByType("navigation").some((each) => "type" in each && each.type === "reload");
