/** Hover: tooltip and cursor for the object under the pointer. */
import { kmh, num, signed } from "../core/format.js";
import { get } from "../core/store.js";
import { hideTip, tipAt } from "../core/tooltip.js";

/**
 * @param {HTMLCanvasElement} canvas
 * @param {(u: number, v: number) => number|null} objectAt its id, by a pixel of the canvas
 * @param {(u: number, v: number) => string} [cursorAt] cursor where there is no object
 */
export function followHover(canvas, objectAt, cursorAt = () => "") {
  let asked = false;
  canvas.addEventListener("pointermove", (event) => {
    if (event.pointerType === "touch" || event.buttons || asked) return;
    asked = true;
    const { offsetX, offsetY, clientX, clientY } = event;
    requestAnimationFrame(() => {
      asked = false;
      const id = get("taping") ? null : objectAt(offsetX, offsetY);
      const item = get("frame")?.result.objects.find((object) => object.id === id);
      canvas.style.cursor = get("taping") ? "crosshair" : item ? "pointer" : cursorAt(offsetX, offsetY);
      if (item) tipAt(clientX, clientY, wordsOf(item));
      else hideTip();
    });
  });
  for (const name of ["pointerleave", "pointerdown"]) canvas.addEventListener(name, hideTip);
}

/** @param {import("../core/types.js").FusedObject} item */
function wordsOf(item) {
  const parts = [`#${item.id} ${item.type ?? "obstacle"} · ${item.carried ? "carried" : item.source}`];
  if (item.distance_m !== null)
    parts.push(`${num(item.distance_m)} m${item.distance_sigma_m === null ? "" : ` ± ${num(item.distance_sigma_m)}`}`);
  const speed = item.velocity_mps ? kmh(item.velocity_mps[0]) : null;
  if (speed !== null) parts.push(`${signed(speed)} km/h relative`);
  if (item.ttc_s !== null) parts.push(`TTC ${num(item.ttc_s)} s`);
  if (item.in_path_probability !== null) parts.push(`in path ${Math.round(100 * item.in_path_probability)}%`);
  return parts.join(" · ");
}
