/** History of a label, newest first: who, when, what. */
import { request } from "../../core/api.js";
import { el } from "../../core/dom.js";

/** @typedef {import("../state/types.js").ItemKind} ItemKind */

/** Acts shown at first. */
const MOST = 6;

/** A list of the acts on one label. */
export class Past {
  /** @type {HTMLElement} */
  node = el("div", { class: "past facts" });
  #key = "";

  /**
   * Show a label's history; fetched again only if the label is another one or has changed.
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
