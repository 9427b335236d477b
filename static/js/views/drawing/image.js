/** Camera overlay: path corridor, and boxes, cuboid and name of each object. */
import { onImage, roleOf } from "../../core/colors.js";
import { num } from "../../core/format.js";
import { isImaged } from "../../core/object_sources.js";
import { get } from "../../core/store.js";

/** @typedef {import("../../core/types.js").Frame} Frame */
/** @typedef {import("../../core/types.js").FusedObject} FusedObject */
/** @typedef {import("../../core/types.js").Pixels} Pixels */
/** @typedef {(pixel: number) => number} Axis  maps an image pixel to a canvas pixel */

/** Of roadside returns, of which a street has a hundred: the vehicles must be seen behind them. */
const ASIDE_ALPHA = 0.4;
const EDGES = [
  [0, 1],
  [1, 2],
  [2, 3],
  [3, 0],
  [4, 5],
  [5, 6],
  [6, 7],
  [7, 4],
  [0, 4],
  [1, 5],
  [2, 6],
  [3, 7],
];

/**
 * @param {CanvasRenderingContext2D} ctx @param {{left: Pixels, right: Pixels}} path
 * @param {Axis} X @param {Axis} Y
 */
export function drawPath(ctx, path, X, Y) {
  const known = (/** @type {Pixels} */ side) => side.filter((pixel) => pixel !== null);
  const left = known(path.left),
    right = known(path.right);
  if (left.length + right.length < 3) return;
  const trace = (/** @type {import("../../core/types.js").Point2[]} */ pixels) => {
    ctx.beginPath();
    pixels.forEach(([u, v], i) => (i ? ctx.lineTo(X(u), Y(v)) : ctx.moveTo(X(u), Y(v))));
  };
  trace([...left, ...[...right].reverse()]);
  ctx.closePath();
  ctx.fillStyle = ctx.strokeStyle = onImage("path");
  ctx.globalAlpha = 0.16;
  ctx.fill();
  ctx.globalAlpha = 0.9;
  ctx.lineWidth = 1.5;
  for (const side of [left, right]) {
    trace(side);
    ctx.stroke();
  }
  ctx.globalAlpha = 1;
}

/**
 * @param {CanvasRenderingContext2D} ctx @param {Frame} frame @param {Record<string, boolean>} layers
 * @param {import("./text_labels.js").Labels} labels @param {Axis} X @param {Axis} Y
 */
export function drawObjects(ctx, { result, display }, layers, labels, X, Y) {
  const lead = result.cipv?.id ?? null,
    next = result.next_cipv?.id ?? null,
    chosen = get("selection");
  const farFirst = [...result.objects].sort((a, b) => (b.distance_m ?? 1e9) - (a.distance_m ?? 1e9));
  for (const item of farFirst) {
    const strong = item.id === lead || item.id === chosen;
    const tint = onImage(roleOf(item, lead));
    const vision = display.vision_boxes[item.id],
      lidar = display.lidar_boxes[item.id],
      corners = display.cuboids[item.id];
    const isAside = !strong && item.id !== next && !deservesTag(item);
    ctx.globalAlpha = isAside ? ASIDE_ALPHA : item.carried ? 0.5 : 1;
    ctx.setLineDash(item.carried ? [4, 3] : []);
    if (layers.cuboids && corners)
      drawCuboid(ctx, corners, strong ? tint : onImage("lidar"), strong ? 2.5 : isAside ? 1 : 1.2, X, Y);
    if (layers.lidarBoxes && lidar) drawBox(ctx, lidar, onImage("lidar"), 1, X, Y);
    if (layers.visionBoxes && vision) drawBox(ctx, vision, strong ? tint : onImage("vision"), strong ? 3 : 1.5, X, Y);
    if (strong && !vision && lidar) drawBox(ctx, lidar, tint, 2.5, X, Y);
    ctx.setLineDash([]);
    if (item.id === chosen && (vision ?? lidar)) drawHalo(ctx, vision ?? lidar, X, Y);
    ctx.globalAlpha = 1;
  }
  for (const item of farFirst.reverse()) {
    const vision = display.vision_boxes[item.id],
      anchor = vision ?? display.lidar_boxes[item.id];
    const isLead = item.id === lead,
      isNext = item.id === next;
    if (!anchor || !(isLead || isNext || item.id === chosen || deservesTag(item))) continue;
    const isShown = vision ? layers.visionBoxes : layers.cuboids || layers.lidarBoxes;
    if (!isShown && !isLead) continue;
    if (!labels.shows(X(anchor[0]), Y(anchor[1]), X(anchor[2]), Y(anchor[3]))) continue;
    const name = isLead ? `CIPV #${item.id}` : `${isNext ? "next " : ""}#${item.id} ${item.type ?? ""}`.trim();
    const words = item.distance_m === null ? name : `${name}  ${num(item.distance_m)} m`;
    labels.put(
      words,
      X(anchor[0]),
      Y(anchor[1]),
      onImage(roleOf(item, lead)),
      isLead ? "strong" : isNext || item.id === chosen ? "must" : "weak",
    );
  }
}

/** No tags for roadside returns and carried objects: they would clutter the image. @param {FusedObject} item */
const deservesTag = (item) => !item.carried && (isImaged(item) || item.in_path);

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {number[]} box
 * @param {string} tint
 * @param {number} width
 * @param {Axis} X
 * @param {Axis} Y
 */
export function drawBox(ctx, [x1, y1, x2, y2], tint, width, X, Y) {
  ctx.strokeStyle = tint;
  ctx.lineWidth = width;
  ctx.strokeRect(X(x1), Y(y1), X(x2) - X(x1), Y(y2) - Y(y1));
}

/**
 * The window of a far view, drawn faintly because it is not an object.
 * @param {CanvasRenderingContext2D} ctx
 * @param {[number, number, number, number]} window
 * @param {string} tint
 * @param {Axis} X
 * @param {Axis} Y
 */
export function drawWindow(ctx, window, tint, X, Y) {
  ctx.globalAlpha = 0.7;
  ctx.setLineDash([2, 4]);
  drawBox(ctx, window, tint, 1, X, Y);
  ctx.setLineDash([]);
  ctx.globalAlpha = 1;
}

/** @param {CanvasRenderingContext2D} ctx @param {number[]} box @param {Axis} X @param {Axis} Y */
function drawHalo(ctx, [x1, y1, x2, y2], X, Y) {
  ctx.strokeStyle = "#fff";
  ctx.lineWidth = 1.5;
  ctx.strokeRect(X(x1) - 4, Y(y1) - 4, X(x2) - X(x1) + 8, Y(y2) - Y(y1) + 8);
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {Pixels} corners
 * @param {string} tint
 * @param {number} width
 * @param {Axis} X
 * @param {Axis} Y
 */
export function drawCuboid(ctx, corners, tint, width, X, Y) {
  ctx.strokeStyle = tint;
  ctx.lineWidth = width;
  ctx.beginPath();
  for (const [a, b] of EDGES) {
    const from = corners[a],
      to = corners[b];
    if (!from || !to) continue;
    ctx.moveTo(X(from[0]), Y(from[1]));
    ctx.lineTo(X(to[0]), Y(to[1]));
  }
  ctx.stroke();
}
