/** Frames in which the two runs differ, between their ribbons. */
import { ui } from "../../core/colors.js";
import { get } from "../../core/store.js";

/** @type {import("./registry.js").Lane} */
export const differences = {
  key: "differences",
  height: () => (get("drive")?.base ? 5 : 0),
  draw(ctx, { span, row }) {
    ctx.fillStyle = ui("warn");
    for (const [first, last] of get("drive")?.comparison?.differing ?? []) {
      const x = span.x(first);
      ctx.fillRect(x, row.top + 1, Math.max(2, span.x(last + 1) - x), row.height - 2);
    }
  },
};
