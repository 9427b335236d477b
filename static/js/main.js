/** Entry point: sets up the panes, then connects the stream. */
import * as align from "./align/mode.js";
import * as banner from "./panels/lead_banner.js";
import * as bev from "./views/plan.js";
import * as camera from "./views/camera.js";
import { connect } from "./core/connection.js";
import { $ } from "./core/dom.js";
import * as drive from "./drive/sync.js";
import * as live from "./drive/live_buffer.js";
import * as object from "./drive/object_curve.js";
import * as ownPlayhead from "./drive/own_playhead.js";
import * as seek from "./drive/seek.js";
import * as shuttle from "./drive/shuttle.js";
import { toEvent } from "./drive/jumps.js";
import * as fleet from "./fleet/view.js";
import * as help from "./keys/help.js";
import * as keyboard from "./keys/keyboard.js";
import * as labeling from "./labeling/setup.js";
import * as layers from "./views/layers.js";
import * as notices from "./panels/notices.js";
import * as objects from "./panels/objects_table.js";
import * as params from "./panels/params.js";
import * as sources from "./panels/open_dialog.js";
import * as exporting from "./timeline/export_menu.js";
import * as timeline from "./timeline/pane.js";
import * as three from "./views/three.js";
import * as trails from "./views/drawing/trails.js";
import * as transport from "./panels/playback_bar.js";
import * as vitals from "./panels/vitals.js";
import * as history from "./panels/undo.js";
import * as runs from "./panels/runs.js";
import * as why from "./panels/why.js";
import * as gutters from "./workspace/gutters.js";
import * as layouts from "./workspace/layouts.js";
import * as more from "./workspace/more.js";
import * as panes from "./workspace/panes.js";
import * as share from "./workspace/share_link.js";
import * as theme from "./workspace/theme.js";

for (const part of [theme, panes, gutters, layers, trails, three, ownPlayhead, seek, shuttle, drive, live, object])
  part.setUp();
// text before canvases: a canvas that measures text forces a layout, and each later change of text another one
for (const part of [banner, objects, why, transport, notices, vitals, camera, bev, timeline, exporting]) part.setUp();
for (const part of [params, history, runs, align, labeling, sources, fleet]) part.setUp();
for (const part of [layouts, more, share, keyboard]) part.setUp();
$("#help-button").addEventListener("click", help.show);
$("#event-back").addEventListener("click", () => toEvent(-1));
$("#event-next").addEventListener("click", () => toEvent(1));
connect();
