/** A row of buttons that scrolls sideways, with faded ends where more of them are out of sight. */

/** @param {HTMLElement} row */
export function scrolls(row) {
  row.addEventListener("scroll", () => markMore(row));
  row.addEventListener("wheel", (event) => scroll(row, event), { passive: false });
  new ResizeObserver(() => markMore(row)).observe(row);
}

/** @param {HTMLElement} row */
export function markMore(row) {
  const { scrollLeft, scrollWidth, clientWidth } = row;
  row.classList.toggle("has-before", scrollLeft > 1);
  row.classList.toggle("has-after", scrollLeft + clientWidth < scrollWidth - 1);
}

/** A wheel without a sideways axis moves it, too. @param {HTMLElement} row @param {WheelEvent} event */
function scroll(row, event) {
  event.preventDefault();
  row.scrollLeft += event.deltaX || event.deltaY;
}
