/** CIPV Studio's page: the panes, then the stream. */
import * as banner from "./banner.js";
import * as bev from "./bev.js";
import * as camera from "./camera.js";
import { connect } from "./connection.js";
import { $ } from "./dom.js";
import * as gutters from "./gutters.js";
import * as help from "./help.js";
import * as keyboard from "./keyboard.js";
import * as layers from "./layers.js";
import * as notices from "./notices.js";
import * as objects from "./objects.js";
import * as params from "./params.js";
import * as sources from "./sources.js";
import * as transport from "./transport.js";
import * as trends from "./trends.js";
import * as vitals from "./vitals.js";
import * as why from "./why.js";
import * as windows from "./window.js";

windows.setUp();
layers.setUp();
for (const part of [trends, banner, camera, bev, objects, why, transport, notices, vitals, params, sources, gutters, keyboard]) part.setUp();
$("#help-button").addEventListener("click", help.show);
connect();
