/** Dialogs of the labeling mode. */
import { $, el } from "../../core/dom.js";

const dialog = $("#label-dialog", HTMLDialogElement);

/**
 * Ask for a line of text; null if cancelled.
 * @param {string} title @param {Node} words @param {string} label @param {string} value
 * @param {number} maxLength in characters; the server refuses longer ones @returns {Promise<string|null>}
 */
export function ask(title, words, label, value, maxLength) {
  const short = value.slice(0, maxLength);
  const input = el("input", { type: "text", value: short, maxLength, required: true, aria: { label } });
  return open(title, words, input, [
    ["Cancel", null],
    ["OK", () => input.value.trim() || null],
  ]);
}

/**
 * Show a dialog with a choice of buttons; the last one submits the form. Null if closed.
 * @template T @param {string} title @param {Node} words @param {Node|null} field
 * @param {[string, (() => T|null)|null][]} ways @returns {Promise<T|null>}
 */
export function open(title, words, field, ways) {
  return new Promise((done) => {
    /** @type {T|null} */
    let answer = null;
    const buttons = ways.map(([label, act], place) =>
      el("button", {
        type: place === ways.length - 1 ? "submit" : "button",
        textContent: label,
        onclick: (/** @type {Event} */ event) => {
          if (place === ways.length - 1 && !form.checkValidity()) return;
          event.preventDefault();
          answer = act?.() ?? null;
          dialog.close();
        },
      }),
    );
    const form = el("form", { method: "dialog" }, words, field, el("div", { class: "dialog-buttons" }, ...buttons));
    dialog.setAttribute("aria-label", title);
    dialog.replaceChildren(el("h2", { textContent: title }), form);
    dialog.addEventListener("close", () => done(answer), { once: true });
    dialog.showModal();
  });
}
