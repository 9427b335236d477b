/** Sets up the labeling mode. */
import { addMode } from "../views/plan.js";
import { addLayer } from "../views/camera.js";
import { addLane } from "../timeline/lanes/registry.js";
import * as acts from "./acts/queue.js";
import * as bar from "./bar/bar.js";
import * as classes from "./state/classes.js";
import * as data from "./state/sync.js";
import * as draft from "./state/draft.js";
import * as frames from "./state/sightings.js";
import { leads } from "./lanes/leads.js";
import { tags } from "./lanes/tags.js";
import { track } from "./lanes/track.js";
import * as mode from "./state/mode.js";
import * as person from "./state/person.js";
import * as panel from "./panels/panel.js";
import { drawInImage } from "./views/image_drawing.js";
import * as imageHand from "./views/image_pointer.js";
import { drawInPlan } from "./views/plan_drawing.js";
import * as planHand from "./views/plan_pointer.js";
import * as projection from "./views/projection.js";
import * as steps from "./state/undo_state.js";
import * as three from "./views/three.js";

export function setUp() {
  const parts = [person, mode, acts, data, steps, frames, draft, projection, three, bar, panel, imageHand, classes];
  for (const part of parts) part.setUp();
  addMode({ isOn: mode.isOn, draw: drawInPlan, ...planHand });
  addLayer(drawInImage, "over");
  for (const lane of [...tags, leads, track]) addLane(lane, "lead"); // above the pipeline's lead
}
