/** Tagged frames, one lane per tag. A drag along a lane marks frames. */
import { ui } from "../../core/colors.js";
import { get } from "../../core/store.js";
import { rangesOf, saidTags, WHOLE_TAG } from "../acts/tags.js";
import { dragMarks } from "./marking.js";

/** @typedef {import("../../timeline/span.js").Span} Span */
/** @typedef {import("../../timeline/rows.js").Row} Row */
/** @typedef {import("../../timeline/lanes/registry.js").Lane} Lane */

const MOST_LANES = 3;

/** @param {number} place from the top @returns {Lane} */
const tagLane = (place) => ({
  key: `label-tags-${place}`,
  height: () => (get("labeling")?.on && place < contents().length ? 13 : 0),
  draw(ctx, { span, row }) {
    for (const word of contents()[place]?.words ?? []) drawTag(ctx, span, row, word);
  },
  redrawOn: ["labeling", "labels"],
  label: () => ({ name: contents()[place]?.name ?? "", value: "", tint: ui("dim") }),
  press: (span, x) => dragMarks(span, span.index(x)),
});

export const tags = Array.from({ length: MOST_LANES }, (_, place) => tagLane(place));
export const topTagKey = tags[0].key;

/**
 * Tags per lane: one each, and all remaining ones in the last. Without tags, one empty lane for marking frames.
 * @returns {{name: string, words: string[]}[]}
 */
function contents() {
  const words = saidTags(),
    rest = words.slice(MOST_LANES - 1);
  if (!words.length) return [{ name: "tags", words: [] }];
  const rows = words.slice(0, MOST_LANES - (rest.length > 1 ? 1 : 0)).map((word) => ({ name: word, words: [word] }));
  return rest.length > 1 ? [...rows, { name: `${rest.length} other tags`, words: rest }] : rows;
}

/** @param {CanvasRenderingContext2D} ctx @param {Span} span @param {Row} row @param {string} word */
function drawTag(ctx, span, row, word) {
  ctx.fillStyle = ui(word === WHOLE_TAG ? "ok" : "accent");
  ctx.globalAlpha = 0.8;
  for (const { first, last } of rangesOf(word)) {
    if (last < span.first || first > span.end) continue;
    const x = Math.max(span.left, span.x(first)),
      end = Math.min(span.left + span.width, span.x(last + 1));
    ctx.fillRect(x, row.top + 3, Math.max(1, end - x - 1), row.height - 6);
  }
  ctx.globalAlpha = 1;
}
