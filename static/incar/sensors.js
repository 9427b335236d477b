/** Sensor health: from the streams of live sensors, or from the contents of a recorded frame. */
import { $, el, keyed, mark, text } from "../js/core/dom.js";
import { num } from "../js/core/format.js";
import { get, on } from "../js/core/store.js";

/** @typedef {"ok"|"stale"|"gone"} Health */
/** @typedef {{key: string, health: Health, detail: string}} Sensor */

/** @type {Record<string, string>} */
const NAMES = { lidar: "LiDAR", camera: "Camera", ego: "Ego speed", gnss: "GNSS" };
/** @type {Record<Health, {shape: string, word: string}>} */
const LOOKS = {
  ok: { shape: "M12 3a9 9 0 1 0 .1 0z", word: "OK" },
  stale: { shape: "M12 3 22 21H2z", word: "late" },
  gone: { shape: "M5 2 12 9l7-7 3 3-7 7 7 7-3 3-7-7-7 7-3-3 7-7-7-7z", word: "missing" },
};

const list = $("#sensors");

export function setUp() {
  on(["frame", "state"], update);
}

function update() {
  const frame = get("frame"),
    streams = get("state")?.streams ?? {};
  if (!frame) return;
  const { sensors, ego } = frame.result;
  /**
   * The sensors that the frame has data of. Ages alone are not enough, since a recording may have no timestamps.
   * @type {Record<string, boolean>}
   */
  const held = { lidar: false, camera: frame.image !== null, ego: ego !== null };
  for (const [key, { points }] of Object.entries(sensors)) if (points !== undefined) held[key] = Boolean(points);
  const known = new Set([...Object.keys(NAMES), ...Object.keys(held)]);
  const keys = [...known].filter((key) => key in held || key in streams);
  keyed(
    list,
    keys.map((key) => look(key, held[key] ?? false, streams[key])),
    ({ key }) => key,
    create,
    show,
  );
}

/**
 * @param {string} key
 * @param {boolean} isHeld by the frame
 * @param {Record<string, any>|undefined} stream
 * @returns {Sensor}
 */
function look(key, isHeld, stream) {
  if (stream) {
    /** @type {Health} */
    const health = stream.state === "ok" ? "ok" : stream.state === "stale" ? "stale" : "gone";
    return {
      key,
      health,
      detail: health === "ok" && stream.rate_hz ? `${num(stream.rate_hz, 0)} Hz` : health === "ok" ? "" : stream.state,
    };
  }
  return isHeld ? { key, health: "ok", detail: "" } : { key, health: "gone", detail: "none" };
}

function create() {
  const li = el("li");
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("role", "img");
  svg.append(document.createElementNS("http://www.w3.org/2000/svg", "path"));
  li.append(svg, el("span"), el("small"));
  return li;
}

/** @param {HTMLElement} li @param {Sensor} sensor */
function show(li, { key, health, detail }) {
  const [svg, name, small] = li.children;
  if (li.dataset.health !== health) {
    svg.setAttribute("aria-label", LOOKS[health].word);
    svg.firstElementChild?.setAttribute("d", LOOKS[health].shape);
  }
  mark(li, "health", health);
  text(name, NAMES[key] ?? key[0].toUpperCase() + key.slice(1));
  text(small, detail);
}
