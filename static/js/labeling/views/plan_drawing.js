/** Labels in the plan view: footprints, and handles of the selected one. */
import { ui } from "../../core/colors.js";
import { trace } from "../../views/drawing/plan.js";
import { get } from "../../core/store.js";
import { footprint, knob, nose } from "./cuboid.js";
import { present } from "../state/draft.js";
import { lookOf } from "./style.js";
import { isOn } from "../state/mode.js";
import { drawPathLabel } from "./path.js";

/** @typedef {import("../state/types.js").Cuboid} Cuboid */
/** @typedef {import("../../views/drawing/viewport.js").Viewport} Viewport */
/** @typedef {import("../../views/drawing/text_labels.js").Labels} Tags */

/** Distance of the rotation knob from the front. */
export const KNOB_PX = 16;
const HANDLE_PX = 3.5;
/** With more vehicles than this, their tags have no class: the list has it. */
const FEW = 10;

/** @param {CanvasRenderingContext2D} ctx @param {Viewport} view @param {Tags} tags */
export function drawInPlan(ctx, view, tags) {
  if (!isOn()) return;
  drawPathLabel(ctx, view);
  const labels = present().flatMap(({ track, cuboid, keyframe }) => {
    const look = cuboid && lookOf(track, false);
    return cuboid && look ? [{ cuboid, keyframe, look, tint: lookOf(track, true)?.tint ?? look.tint }] : [];
  });
  for (const { cuboid, keyframe, look } of labels) drawOne(ctx, view, cuboid, keyframe, look);
  const chosen = labels.find(({ look }) => look.isChosen);
  if (chosen) drawHandles(ctx, view, chosen.cuboid);
  drawTags(view, tags, labels);
  const draft = get("draft");
  if (draft?.track === null && draft.cuboid)
    drawOne(ctx, view, draft.cuboid, true, {
      tint: ui("accent"),
      dash: [],
      width: 2.5,
      isLead: false,
      isChosen: true,
      isFacing: true,
      role: "path",
      name: "",
      number: "",
    });
}

/**
 * Name tags beside the vehicles, on none of them; first the selected one and the lead.
 * @param {Viewport} view
 * @param {Tags} tags
 * @param {{cuboid: Cuboid, look: import("./style.js").Look, tint: string}[]} labels
 */
function drawTags(view, tags, labels) {
  const placed = labels.map(({ cuboid, look, tint }) => {
    const corners = footprint(cuboid),
      us = corners.map(([, y]) => view.u(y)),
      vs = corners.map(([x]) => view.v(x));
    const rank = Number(look.isChosen) * 2 + Number(look.isLead);
    return { look, tint, rank, u1: Math.min(...us), u2: Math.max(...us), v1: Math.min(...vs), v2: Math.max(...vs) };
  });
  for (const { u1, u2, v1, v2 } of placed) tags.keepFree(u1, v1, u2 - u1, v2 - v1);
  for (const { look, tint, rank, u1, u2, v1 } of placed.sort((a, b) => b.rank - a.rank)) {
    const name = rank || placed.length <= FEW ? look.name : look.number,
      weight = look.isLead ? "strong" : look.isChosen ? "must" : "weak";
    tags.put(name, u2 + 4, v1 + 14, look.isChosen ? "#fff" : tint, weight, u1 - 4);
  }
}

/**
 * @param {CanvasRenderingContext2D} ctx
 * @param {Viewport} view
 * @param {Cuboid} cuboid
 * @param {boolean} isKeyframe
 * @param {import("./style.js").Look} look
 */
function drawOne(ctx, view, cuboid, isKeyframe, look) {
  ctx.strokeStyle = ctx.fillStyle = look.tint;
  trace(ctx, view, footprint(cuboid));
  ctx.closePath();
  ctx.globalAlpha = look.isLead ? 0.35 : 0.14;
  ctx.fill();
  ctx.globalAlpha = 1;
  ctx.lineWidth = look.width;
  ctx.setLineDash(look.dash);
  ctx.stroke();
  ctx.setLineDash([]);
  if (look.isFacing) {
    trace(ctx, view, [[cuboid.center[0], cuboid.center[1]], nose(cuboid)]);
    ctx.stroke();
  }
  if (!isKeyframe) return;
  ctx.beginPath();
  ctx.arc(view.u(cuboid.center[1]), view.v(cuboid.center[0]), HANDLE_PX - 0.5, 0, 2 * Math.PI);
  ctx.fill();
}

/** @param {CanvasRenderingContext2D} ctx @param {Viewport} view @param {Cuboid} cuboid */
function drawHandles(ctx, view, cuboid) {
  const corners = footprint(cuboid),
    at = knob(cuboid, KNOB_PX / view.scale);
  ctx.strokeStyle = ui("text");
  ctx.fillStyle = ui("panel");
  ctx.lineWidth = 1.5;
  trace(ctx, view, [nose(cuboid), at]);
  ctx.stroke();
  const edges = corners.map(
    ([x, y], place) =>
      /** @type {[number, number]} */ ([(x + corners[(place + 1) % 4][0]) / 2, (y + corners[(place + 1) % 4][1]) / 2]),
  );
  for (const [x, y] of [...edges, at]) {
    ctx.beginPath();
    ctx.arc(view.u(y), view.v(x), HANDLE_PX, 0, 2 * Math.PI);
    ctx.fill();
    ctx.stroke();
  }
}
