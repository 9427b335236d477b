/** The CIPV of each frame in the run that is compared against. A click selects it. */
import { get } from "../../core/store.js";
import { leadLabel, selectLead } from "./lead.js";
import { drawRibbon } from "./lead_ribbon.js";

/** @type {import("./registry.js").Lane} */
export const comparedLead = {
  key: "compared-lead",
  height: () => (get("drive")?.base ? 12 : 0),
  draw(ctx, place) {
    const run = get("drive")?.base;
    if (!run) return;
    ctx.globalAlpha = 0.75;
    drawRibbon(ctx, run, place);
    ctx.globalAlpha = 1;
  },
  label: (index, isLight) => leadLabel("compared", get("drive")?.base, index, isLight),
  click: (span, x) => selectLead(get("drive")?.base, span.index(x)),
};
