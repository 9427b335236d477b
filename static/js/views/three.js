/** Tells the server's 3D view what is selected, and whether it is visible. */
import { tell } from "../core/connection.js";
import { $ } from "../core/dom.js";
import { get, on } from "../core/store.js";

export function setUp() {
  const body = $("#three-body");
  let isShown = false;
  const say = () => tell("hides_3d", body.firstChild !== null && (!isShown || document.hidden));
  new ResizeObserver(([{ contentRect }]) => {
    isShown = contentRect.width > 0 && contentRect.height > 0;
    say();
  }).observe(body);
  document.addEventListener("visibilitychange", say);
  on(["selection"], () => tell("selected", get("selection")));
}
