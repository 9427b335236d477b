/** Small helpers to find, build and change elements. */

/**
 * The element that a selector names; throws when there is none or it is of another kind.
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
 * Set text only when it differs: the table asks for this hundreds of times a second.
 * @param {Node} node
 * @param {string} value
 */
export function text(node, value) {
  if (node.textContent !== value) node.textContent = value;
}

/** Set a data attribute only when it differs. @param {HTMLElement} node @param {string} name @param {string} value */
export function mark(node, name, value) {
  if (node.dataset[name] !== value) node.dataset[name] = value;
}

/** @type {WeakMap<Element, Map<string, any>>} */
const kept = new WeakMap();

/**
 * Children of `parent`, one an item, in the items' order. A child is made once and changed after that, so that it is
 * not replaced under a finger while frames go by.
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
 * The element a listener was called for, when it is inside one that matches.
 * @param {Event} event
 * @param {string} selector
 */
export function within(event, selector) {
  return event.target instanceof Element ? /** @type {HTMLElement|null} */ (event.target.closest(selector)) : null;
}

/** @param {HTMLCanvasElement} canvas @param {CanvasRenderingContext2DSettings} [settings] */
export function context(canvas, settings) {
  const ctx = canvas.getContext("2d", settings);
  if (!ctx) throw new Error("this browser draws no canvas");
  return ctx;
}

/** Remember a setting of this browser; a browser that refuses storage simply forgets. */
export const memory = {
  /** @template T @param {string} key @param {T} fallback @returns {T} */
  read(key, fallback) {
    try {
      return JSON.parse(localStorage.getItem(`cipv.${key}`) ?? "null") ?? fallback;
    } catch {
      return fallback;
    }
  },
  /** @param {string} key @param {unknown} value */
  write(key, value) {
    try {
      localStorage.setItem(`cipv.${key}`, JSON.stringify(value));
    } catch {
      // storage is off
    }
  },
};
