/** Pointer input on the camera in alignment mode: maps drags and scrolling to parameters. */
import { place } from "../views/camera.js";
import { change } from "../panels/params.js";
import { get } from "../core/store.js";

/** @typedef {Record<string, number>} Values */

const SCALE_PER_PX = 0.0002,
  ROLL_PER_PX_DEG = 0.004;
/** Scrolling has ended after this pause. */
const REST_MS = 400;

/** @param {HTMLCanvasElement} canvas @param {() => boolean} isOn */
export function followHand(canvas, isOn) {
  /** @type {{x: number, y: number, from: Values, last: Values}|null} */
  let drag = null;
  let rest = 0;
  canvas.addEventListener("pointerdown", (event) => {
    if (!isOn()) return;
    canvas.setPointerCapture(event.pointerId);
    const from = present();
    drag = { x: event.clientX, y: event.clientY, from, last: {} };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!drag) return;
    drag.last = shifted(drag.from, event.clientX - drag.x, event.clientY - drag.y);
    change(drag.last, false);
  });
  const lift = () => {
    if (drag && Object.keys(drag.last).length) change(drag.last, true);
    drag = null;
  };
  for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) canvas.addEventListener(name, lift);
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (!isOn()) return;
      event.preventDefault();
      const turned = wheeled(present(), event.deltaY || event.deltaX, event.shiftKey);
      change(turned, false);
      clearTimeout(rest);
      rest = setTimeout(() => change(turned, true), REST_MS);
    },
    { passive: false },
  );
}

/** Current alignment values, whether set or taken from the calibration. @returns {Values} */
function present() {
  const params = get("params");
  const names = ["h_res_deg", "v_res_deg", "cx_px", "cy_px", "yaw_deg", "pitch_deg", "roll_deg"];
  return Object.fromEntries(
    names.map((name) => [
      name,
      Number(params?.values[`alignment.${name}`] ?? params?.effective[`alignment.${name}`] ?? 0),
    ]),
  );
}

const isAngular = () => get("params")?.values["alignment.model"] === "angular";

/**
 * Parameters for a point cloud shifted by so many canvas pixels. Yawing the mount left moves the cloud right; pitching
 * it down moves the cloud up.
 * @param {Values} from
 * @param {number} dx
 * @param {number} dy
 * @returns {Values}
 */
function shifted(from, dx, dy) {
  const perPixel = 1 / (place().scale * (get("frame")?.image?.scale ?? 1));
  const du = dx * perPixel,
    dv = dy * perPixel;
  if (isAngular())
    return { "alignment.cx_px": Math.round(from.cx_px + du), "alignment.cy_px": Math.round(from.cy_px + dv) };
  return {
    "alignment.yaw_deg": rounded(from.yaw_deg + du * from.h_res_deg, 3),
    "alignment.pitch_deg": rounded(from.pitch_deg - dv * from.v_res_deg, 3),
  };
}

/** @param {Values} from @param {number} turn @param {boolean} onlyDown @returns {Values} */
function wheeled(from, turn, onlyDown) {
  if (!isAngular()) return { "alignment.roll_deg": rounded(from.roll_deg + turn * ROLL_PER_PX_DEG, 3) };
  const factor = Math.exp(turn * SCALE_PER_PX),
    down = { "alignment.v_res_deg": rounded(from.v_res_deg * factor, 5) };
  return onlyDown ? down : { ...down, "alignment.h_res_deg": rounded(from.h_res_deg * factor, 5) };
}

/** @param {number} value @param {number} digits */
const rounded = (value, digits) => Number(value.toFixed(digits));
