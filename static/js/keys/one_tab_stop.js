/**
 * Lists of many rows, of which Tab reaches one and the arrow keys the others; otherwise, keyboard users would press Tab
 * once per row to get past them (WAI-ARIA Authoring Practices, roving tabindex).
 */

/**
 * @param {HTMLElement} list
 * @param {string} rows selector of its rows
 * @param {(row: HTMLElement) => void} [onMove] called with the row that an arrow key moved to
 * @returns {(preferred?: HTMLElement|null) => void} to be called when rows were added or removed: Tab then reaches the
 *   row that has the focus, else the preferred one, else the same one as before, else the first
 */
export function oneTabStop(list, rows, onMove) {
  /** @type {HTMLElement|null} */
  let stop = null;
  const all = () => /** @type {HTMLElement[]} */ ([...list.querySelectorAll(rows)]);
  const within = (/** @type {Element|null} */ node) =>
    list.contains(node) ? /** @type {HTMLElement|null} */ (node?.closest(rows) ?? null) : null;

  const keep = (/** @type {HTMLElement|null} */ preferred = null) => {
    const present = all(),
      before = stop && present.includes(stop) ? stop : null;
    stop = within(document.activeElement) ?? preferred ?? before ?? present[0] ?? null;
    for (const row of present) {
      const place = row === stop ? 0 : -1;
      if (row.tabIndex !== place) row.tabIndex = place;
    }
  };
  list.addEventListener("focusin", () => keep());
  list.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key],
      row = within(/** @type {Element} */ (event.target));
    if (!step || !row) return;
    const present = all(),
      next = present[present.indexOf(row) + step];
    if (!next) return;
    event.preventDefault();
    next.focus();
    onMove?.(next);
  });
  return keep;
}
