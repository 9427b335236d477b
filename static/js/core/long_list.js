/** A long list that scrolls. */
import { mark } from "./dom.js";

/** At ten frames a second there is no time to update rows out of sight. */
const REST_AFTER_MS = 300;
/** Rows settle this long after the pointer has left: a tap ends with a click after its pointer has left. */
const SETTLE_AFTER_MS = 300;
/** Maximum number of rows kept in place for items that have left the list: about a screenful. */
const MOST_GONE = 30;

/**
 * Rows are bound to positions: when the order changes, a row shows another item, which is cheaper than moving elements.
 * Visible rows update at once, others when the list has not changed for a while; until then the list is `aria-busy`.
 * Each row's `data-id` is always up to date.
 *
 * While the pointer is over the list, every row keeps its item, so that a press hits what it was aimed at: new items
 * are appended, and the rows of items that have left are `is-gone`. Afterwards, the list settles into its own order and
 * dispatches `settle`.
 * @template T
 */
export class LongList {
  #parent;
  #keyOf;
  #create;
  #fill;
  /** As shown. @type {T[]} */
  #items = [];
  /** As they should be. @type {T[]} */
  #latest = [];
  #isHeld = false;
  #settling = 0;
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
    parent.addEventListener("pointerenter", () => this.#hold(true));
    for (const end of ["pointerleave", "pointercancel"]) parent.addEventListener(end, () => this.#hold(false));
  }

  /** Whether the pointer is over the list, or was a moment ago. */
  get isHeld() {
    return this.#isHeld;
  }

  /** Put the rows into their order now. */
  settle() {
    clearTimeout(this.#settling);
    this.#isHeld = false;
    this.show(this.#latest);
    this.#parent.dispatchEvent(new Event("settle"));
  }

  /** @param {T[]} items */
  show(items) {
    this.#latest = items;
    const present = new Set(items.map(this.#keyOf));
    this.#items = this.#isHeld ? this.#inPlace(items, present) : items;
    for (const { node } of this.#rows.splice(this.#items.length)) {
      this.#watch.unobserve(node);
      node.remove();
    }
    while (this.#rows.length < this.#items.length) this.#add();
    this.#rows.forEach((row, place) => {
      const key = this.#keyOf(this.#items[place]);
      mark(row.node, "id", String(key));
      row.node.classList.toggle("is-gone", !present.has(key));
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

  /** @param {boolean} isOver whether the pointer is over the list */
  #hold(isOver) {
    clearTimeout(this.#settling);
    if (isOver) this.#isHeld = true;
    else this.#settling = setTimeout(() => this.settle(), SETTLE_AFTER_MS);
  }

  /**
   * The items in the places they have now, then the new ones; in their own order if too many have left.
   * @param {T[]} items @param {Set<string|number>} present their keys @returns {T[]}
   */
  #inPlace(items, present) {
    const gone = this.#items.filter((item) => !present.has(this.#keyOf(item)));
    if (gone.length > MOST_GONE) return items;
    const shown = new Set(this.#items.map(this.#keyOf)),
      latest = new Map(items.map((item) => [this.#keyOf(item), item]));
    return [
      ...this.#items.map((item) => latest.get(this.#keyOf(item)) ?? item),
      ...items.filter((item) => !shown.has(this.#keyOf(item))),
    ];
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
