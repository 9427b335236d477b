/** The in-vehicle display: each part draws from the store, and `freshness` covers stale data. */
import { connect } from "../js/core/connection.js";
import * as acc from "./acc.js";
import * as awake from "./wake_lock.js";
import * as buttons from "./buttons.js";
import * as freshness from "./freshness.js";
import * as lead from "./lead.js";
import * as night from "./night.js";
import * as plan from "./plan.js";
import * as road from "./road.js";
import * as sensors from "./sensors.js";

for (const part of [night, freshness, acc, lead, road, plan, sensors, buttons, awake]) part.setUp();
connect();
