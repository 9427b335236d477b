/** Where the shown labels lie in the picture. The server projects, as always; a cuboid under a hand is asked for as it moves. */
import { newestOnly, request } from "../api.js";
import { get, on, set } from "../store.js";
import { present } from "./draft.js";
import { shown } from "./held.js";
import { isOn } from "./mode.js";

/** @typedef {import("./types.js").Cuboid} Cuboid */
/** By track; −1 is a new one. Pixels of the camera's own picture. @typedef {{frame: number, pixels: Map<number, import("../types.js").Pixels>}} Projected */

export const NEW = -1;

const project = newestOnly(async (/** @type {{frame: number, cuboids: Map<number, Cuboid>}} */ { frame, cuboids }) => {
  const answer = cuboids.size ? await request("api/project", "POST", { cuboids: [...cuboids.values()] }).catch(() => null) : { pixels: [] };
  if (!answer) return;
  const places = answer.pixels ?? [];
  set("projected", { frame, pixels: new Map([...cuboids.keys()].flatMap((id, place) => (places[place] ? [[id, places[place]]] : []))) });
});

export function setUp() {
  on(["frame", "labels", "labelFrames", "draft", "labeling"], () => {
    if (!isOn() || !get("labels")) return;
    const draft = get("draft"), frame = shown();
    /** @type {[number, Cuboid][]} */
    const cuboids = present().flatMap(({ track, cuboid }) => (cuboid ? [[track, cuboid]] : []));
    if (draft?.track === null && draft.cuboid && draft.frame === frame) cuboids.push([NEW, draft.cuboid]);
    project({ frame, cuboids: new Map(cuboids) });
  });
}
