/** Small helpers to build elements. */

/** @param {string} selector @returns {any} */
export const $ = (selector) => document.querySelector(selector);

/**
 * An element. `props` are properties, except `class`, `data` (dataset), `aria` and `style` (CSS custom properties).
 * @returns {any}
 */
export function el(tag, props = {}, ...children) {
  const node = document.createElement(tag);
  const { class: className, data, aria, style, ...rest } = props;
  if (className) node.className = className;
  for (const [key, value] of Object.entries(data ?? {})) node.dataset[key] = value;
  for (const [key, value] of Object.entries(aria ?? {})) node.setAttribute(key === "role" ? "role" : `aria-${key}`, value);
  for (const [key, value] of Object.entries(style ?? {})) node.style.setProperty(key, value);
  Object.assign(node, rest);
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

/** Set text only when it differs: the table asks for this hundreds of times a second. */
export function text(node, value) {
  if (node.textContent !== value) node.textContent = value;
}

/** Set an attribute-like property only when it differs. */
export function mark(node, name, value) {
  if (node.dataset[name] !== value) node.dataset[name] = value;
}

/** A canvas fitted to its box at the screen's resolution. @returns {{ctx: CanvasRenderingContext2D, width: number, height: number}} */
export function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  return { ctx, width, height };
}

/** Remember a setting of this browser; a browser that refuses storage simply forgets. */
export const memory = {
  read(key, fallback) {
    try {
      return JSON.parse(localStorage.getItem(`cipv.${key}`)) ?? fallback;
    } catch {
      return fallback;
    }
  },
  write(key, value) {
    try {
      localStorage.setItem(`cipv.${key}`, JSON.stringify(value));
    } catch {
      // storage is off
    }
  },
};
