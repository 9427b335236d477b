/**
 * How well points and image match, by image region (heat map and arrows) and by distance (text). An arrow shows where
 * the points should move; a region without colour has no score.
 */
import { el, press } from "../core/dom.js";
import { get, on, set } from "../core/store.js";

/** @typedef {import("../core/types.js").AlignmentScore} AlignmentScore */
/** @typedef {import("../core/types.js").MatchRange} MatchRange */

/** Factor by which arrows are longer than the shift, so that a few pixels are visible. */
const LENGTHEN = 3;
const HEAD_PX = 7;
const GOOD_HUE = 130;
const DARK = "rgb(0 0 0 / 75%)";

/** @type {AlignmentScore|null} */
let known = null;

/** Switches the overlay. */
export const regionsButton = el("button", {
  type: "button",
  textContent: "Regions",
  title: "Show the score by image region: green fits, red does not, arrows show where the points should move",
  onclick: () => {
    const align = get("align");
    if (align) set("align", { ...align, regions: !align.regions });
  },
});
/** The score by distance. */
export const rangesRow = el("span", { class: "ranges" });

on(["align"], () => press(regionsButton, get("align")?.regions === true));

/** @param {AlignmentScore|null} score */
export function showRegions(score) {
  known = score;
  rangesRow.title = "";
  if (score?.score === null) return rangesRow.replaceChildren(score.text);
  rangesRow.replaceChildren("Match by distance: ", ...(score?.ranges ?? []).flatMap(rangeText));
  rangesRow.title = score
    ? `Match by distance, and how far the points should move there. “?”: too few or unclear edges.`
    : "";
}

/** @param {MatchRange} range */
function rangeText({ from_m, to_m, score, shift_px: shift, borders }) {
  const name = to_m === null ? `> ${from_m} m` : `${from_m}–${to_m} m`;
  const move = shift && (shift[0] || shift[1]) ? ` ${arrow(shift)}` : "";
  const said = score === null ? "?" : `${Math.round(100 * score)} %${move}`;
  return [
    el("span", { textContent: `${name} ` }),
    el("b", {
      textContent: said,
      title: `${borders} depth edges`,
      style: score === null ? {} : { "--hue": hue(score) },
    }),
  ];
}

/** @param {[number, number]} shift */
function arrow([across, down]) {
  const parts = [];
  if (across) parts.push(`${across > 0 ? "→" : "←"}${Math.abs(Math.round(across))}`);
  if (down) parts.push(`${down > 0 ? "↓" : "↑"}${Math.abs(Math.round(down))}`);
  return `${parts.join(" ")} px`;
}

/** @param {number} score */
const hue = (score) => String(Math.round(GOOD_HUE * score));

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {import("../core/types.js").Frame} frame
 * @param {{x: number, y: number, scale: number}} place
 */
export function drawRegions(ctx, frame, place) {
  const { image } = frame;
  if (!image || !known?.regions.length) return;
  const { columns, rows, regions } = known;
  const width = (image.width * place.scale) / columns,
    height = (image.height * place.scale) / rows;
  const perPixel = place.scale * (image.scale ?? 1);
  ctx.save();
  regions.forEach((region, number) => {
    if (region.score === null || !region.shift_px) return;
    const x = place.x + (number % columns) * width,
      y = place.y + Math.floor(number / columns) * height;
    ctx.fillStyle = `hsl(${hue(region.score)} 90% 50% / 22%)`;
    ctx.fillRect(x + 1, y + 1, width - 2, height - 2);
    drawArrow(ctx, x + width / 2, y + height / 2, region.shift_px, perPixel * LENGTHEN, hue(region.score));
  });
  ctx.restore();
}

/**
 * A dot instead of an arrow if nothing has to move.
 * @param {CanvasRenderingContext2D} ctx
 * @param {number} x
 * @param {number} y
 * @param {[number, number]} shift
 * @param {number} scale
 * @param {string} tint
 */
function drawArrow(ctx, x, y, [across, down], scale, tint) {
  const toX = x + across * scale,
    toY = y + down * scale,
    angle = Math.atan2(down, across);
  const path = new Path2D();
  if (!across && !down) path.arc(x, y, HEAD_PX / 2, 0, 2 * Math.PI);
  else {
    path.moveTo(x, y);
    path.lineTo(toX, toY);
    for (const turn of [2.6, -2.6]) {
      path.moveTo(toX, toY);
      path.lineTo(toX + HEAD_PX * Math.cos(angle + turn), toY + HEAD_PX * Math.sin(angle + turn));
    }
  }
  for (const [color, line] of /** @type {[string, number][]} */ ([
    [DARK, 5],
    [`hsl(${tint} 95% 60%)`, 2.5],
  ])) {
    ctx.strokeStyle = color;
    ctx.lineWidth = line;
    ctx.stroke(path);
  }
}
