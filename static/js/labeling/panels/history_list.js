/** What was done to a label, newest first: who, when, what. */
import { request } from "../../core/api.js";
import { el } from "../../core/dom.js";

/** @typedef {import("../state/types.js").ItemKind} ItemKind */

/** Acts that are shown before one asks for all. */
const MOST = 6;

/** A list that tells the acts of one label. */
export class Past {
  /** @type {HTMLElement} */
  node = el("div", { class: "past facts" });
  #key = "";

  /**
   * Show a label's acts; they are asked for again when it is another, or has changed.
   * @param {ItemKind} kind
   * @param {number} id
   * @param {number} revision
   */
  async look(kind, id, revision) {
    const key = `${kind} ${id} ${revision}`;
    if (key === this.#key) return;
    this.#key = key;
    /** @type {import("../state/types.js").PastAct[]|null} */
    const acts = await request(`api/labels/history?kind=${kind}&id=${id}`).catch(() => null);
    if (key !== this.#key) return;
    if (acts) this.#show(acts, MOST);
    else this.#key = "";
  }

  /** @param {import("../state/types.js").PastAct[]} acts @param {number} most */
  #show(acts, most) {
    const rest = acts.length - most;
    this.node.replaceChildren(
      el("ol", {}, ...acts.slice(0, most).map(row)),
      rest > 0
        ? el("button", {
            type: "button",
            class: "quiet",
            textContent: `${rest} earlier`,
            onclick: () => this.#show(acts, acts.length),
          })
        : "",
    );
  }
}

/** @param {import("../state/types.js").PastAct} act */
const row = ({ what, note, person, t_unix_ms, undone }) =>
  el(
    "li",
    { class: undone ? "is-undone" : "", title: new Date(t_unix_ms).toLocaleString("en-GB") },
    `${new Date(t_unix_ms).toLocaleTimeString("en-GB")} ${person}: ${[what, note].filter(Boolean).join("; ")}`,
    undone ? " (undone)" : "",
  );
