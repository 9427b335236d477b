/**
 * Projects the current labels into the image. The server does the projection, also during a drag.
 */
import { newestOnly, request } from "../../core/api.js";
import { get, on, set } from "../../core/store.js";
import { present } from "../state/draft.js";
import { shown } from "../state/labels.js";
import { isOn } from "../state/mode.js";

/** @typedef {import("../state/types.js").Cuboid} Cuboid */
/**
 * Pixels of the full camera image by track; −1 is a new one.
 * @typedef {{frame: number, pixels: Map<number, import("../../core/types.js").Pixels>}} Projected
 */

export const NEW = -1;

const project = newestOnly(async (/** @type {{frame: number, cuboids: Map<number, Cuboid>}} */ { frame, cuboids }) => {
  const answer = cuboids.size
    ? await request("api/project", "POST", { cuboids: [...cuboids.values()] }).catch(() => null)
    : { pixels: [] };
  if (!answer) return;
  const places = answer.pixels ?? [];
  set("projected", {
    frame,
    pixels: new Map([...cuboids.keys()].flatMap((id, place) => (places[place] ? [[id, places[place]]] : []))),
  });
});

/** Maximum number of cuboids that the server projects or draws. */
const MOST = 150;

/** The nearest ones, and the selected one. @param {[number, Cuboid][]} cuboids @returns {[number, Cuboid][]} */
export function nearest(cuboids) {
  if (cuboids.length <= MOST) return cuboids;
  const away = (
    /** @type {[number, Cuboid]} */ [
      id,
      {
        center: [x, y],
      },
    ],
  ) => (id === get("track") ? -1 : x < 0 ? Infinity : Math.hypot(x, y));
  return cuboids.sort((a, b) => away(a) - away(b)).slice(0, MOST);
}

export function setUp() {
  on(["frame", "labels", "labelFrames", "draft", "labeling"], () => {
    if (!isOn() || !get("labels")) return;
    const draft = get("draft"),
      frame = shown();
    /** @type {[number, Cuboid][]} */
    const cuboids = nearest(present().flatMap(({ track, cuboid }) => (cuboid ? [[track, cuboid]] : [])));
    if (draft?.track === null && draft.cuboid && draft.frame === frame) cuboids.push([NEW, draft.cuboid]);
    project({ frame, cuboids: new Map(cuboids) });
  });
}
