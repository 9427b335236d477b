/** The labeling mode's parts, put together. */
import { addMode } from "../bev.js";
import { addLayer } from "../camera.js";
import * as acts from "./acts.js";
import * as bar from "./bar.js";
import * as data from "./data.js";
import * as draft from "./draft.js";
import * as frames from "./frames.js";
import * as mode from "./mode.js";
import * as panel from "./panel.js";
import { drawInPicture } from "./picture.js";
import * as pictureHand from "./picturehand.js";
import { drawInPlan } from "./plan.js";
import * as planHand from "./planhand.js";
import * as projection from "./projection.js";
import * as steps from "./steps.js";
import * as three from "./three.js";

export function setUp() {
  for (const part of [mode, acts, data, steps, frames, draft, projection, three, bar, panel, pictureHand]) part.setUp();
  addMode({ isOn: mode.isOn, draw: drawInPlan, ...planHand });
  addLayer(drawInPicture, "over");
}
