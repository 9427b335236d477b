/** A long list that scrolls. */
import { mark } from "./dom.js";

/** At ten frames a second there is no time to update rows out of sight. */
const REST_AFTER_MS = 300;

/**
 * Rows are bound to positions: when the order changes, a row shows another item, which is cheaper than moving elements.
 * Visible rows update at once, others when the list has not changed for a while; until then the list is `aria-busy`.
 * Each row's `data-id` is always up to date.
 * @template T
 */
export class LongList {
  #parent;
  #keyOf;
  #create;
  #fill;
  /** @type {T[]} */
  #items = [];
  /** @type {{node: HTMLElement, isSeen: boolean, isOld: boolean}[]} */
  #rows = [];
  #rest = 0;
  #watch = new IntersectionObserver((seen) => this.#follow(seen));

  /**
   * @param {HTMLElement} parent @param {(item: T) => string|number} keyOf
   * @param {() => HTMLElement} create an empty row @param {(row: HTMLElement, item: T) => void} fill
   */
  constructor(parent, keyOf, create, fill) {
    this.#parent = parent;
    this.#keyOf = keyOf;
    this.#create = create;
    this.#fill = fill;
  }

  /** @param {T[]} items */
  show(items) {
    this.#items = items;
    for (const { node } of this.#rows.splice(items.length)) {
      this.#watch.unobserve(node);
      node.remove();
    }
    while (this.#rows.length < items.length) this.#add();
    this.#rows.forEach((row, place) => {
      mark(row.node, "id", String(this.#keyOf(items[place])));
      row.isOld = true;
      if (row.isSeen) this.#renew(place);
    });
    clearTimeout(this.#rest);
    if (this.#tellBusy()) this.#rest = setTimeout(() => this.#renewAll(), REST_AFTER_MS);
  }

  /**
   * The row of the item with a key, or null.
   * @param {string|number} key
   * @returns {HTMLElement|null}
   */
  rowOf(key) {
    const place = this.#items.findIndex((item) => this.#keyOf(item) === key);
    return this.#rows[place]?.node ?? null;
  }

  #add() {
    const node = this.#create();
    this.#rows.push({ node, isSeen: true, isOld: true }); // until the observer says otherwise
    this.#parent.append(node);
    this.#watch.observe(node);
  }

  /** @param {IntersectionObserverEntry[]} entries */
  #follow(entries) {
    const sight = new Map(entries.map(({ target, isIntersecting }) => [target, isIntersecting]));
    this.#rows.forEach((row, place) => {
      row.isSeen = sight.get(row.node) ?? row.isSeen;
      if (row.isSeen) this.#renew(place);
    });
    this.#tellBusy();
  }

  /** @param {number} place */
  #renew(place) {
    const row = this.#rows[place];
    if (row.isOld) this.#fill(row.node, this.#items[place]);
    row.isOld = false;
  }

  #renewAll() {
    this.#rows.forEach((_, place) => this.#renew(place));
    this.#tellBusy();
  }

  /** @returns {boolean} whether some rows are outdated */
  #tellBusy() {
    const isBusy = this.#rows.some(({ isOld }) => isOld);
    if (this.#parent.ariaBusy !== String(isBusy)) this.#parent.ariaBusy = String(isBusy);
    return isBusy;
  }
}
