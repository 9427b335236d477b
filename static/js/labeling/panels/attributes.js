/** Attributes of the selected track: in the marked frames, or in all frames of the track. */
import { el } from "../../core/dom.js";
import { get, on, paint } from "../../core/store.js";
import { act } from "../acts/queue.js";
import { attributes } from "../state/classes.js";
import { presentOf } from "../state/draft.js";
import { chosen, shown } from "../state/labels.js";
import { span } from "../state/marked_frames.js";

/** Those that belong to each frame's sighting. */
const OF_SIGHTINGS = ["occlusion", "truncation"];
const NOTHING = "";

export const node = el("div", { class: "attributes" });
/** @type {Map<string, HTMLSelectElement>} */
const lists = new Map();

export function setUp() {
  on(["classes"], build);
  paint(["track", "labels", "labelFrames", "frame", "classes"], show);
}

function build() {
  lists.clear();
  node.replaceChildren(
    ...attributes().map(({ name, values }) => {
      const list = el(
        "select",
        { aria: { label: name }, title: `${name}: in the marked frames (I, O), or in all frames of the track` },
        ...[NOTHING, ...values].map((value) => el("option", { value, textContent: value || "–" })),
      );
      list.addEventListener("change", () => {
        put(name, list.value || null);
        list.blur();
      });
      lists.set(name, list);
      return el("label", {}, el("span", { textContent: name }), list);
    }),
  );
}

/** @param {string} name @param {string|null} value */
function put(name, value) {
  const track = chosen();
  if (!track || track.first === null || track.last === null) return;
  const frames = get("marked") ? span() : { first: track.first, last: track.last };
  act({ kind: "set_attribute", track: track.id, revision: track.revision, name, value, ...frames });
}

function show() {
  const track = chosen(),
    at = shown();
  node.hidden = !track;
  if (!track) return;
  const sighting = presentOf(track.id);
  for (const [name, list] of lists) {
    if (document.activeElement === list) continue;
    const said = OF_SIGHTINGS.includes(name)
      ? sighting?.[/** @type {"occlusion"|"truncation"} */ (name)]
      : track.attributes.find((each) => each.name === name && each.first <= at && at <= each.last)?.value;
    const value = said === null || said === undefined ? NOTHING : String(said);
    if (value && ![...list.options].some((option) => option.value === value))
      list.append(el("option", { value, textContent: value }));
    list.value = value;
  }
}
