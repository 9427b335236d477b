/**
 * The lead banner: CIPV, distance, closing speed, time to collision and ACC state.
 */
import { roleOf } from "../core/colors.js";
import { get, on } from "../core/store.js";
import { $, el, mark, text } from "../core/dom.js";
import { DASH, kmh, num, signed, ttc as ttcWords } from "../core/format.js";
import { ACC_WORDS, urgencyOf } from "../core/urgency.js";

/** @typedef {import("../core/types.js").Result} Result */
/** @typedef {import("../core/types.js").Cipv} Cipv */

const source = el("span", { class: "pill" }),
  name = el("span"),
  provisional = el("span", {
    class: "tag",
    textContent: "provisional",
    title: "The whole drive is still being computed: CIPV, ACC and object IDs of this frame may change",
    hidden: true,
  }),
  reason = el("p", { class: "reason" });
const lead = el(
  "div",
  { class: "card lead" },
  el("div", { class: "title", aria: { live: "polite" } }, source, name, provisional),
  reason,
);
const distance = figure("distance", "Distance", "m"),
  closing = figure("closing", "Closing speed", "km/h"),
  ttc = figure("ttc", "Time to collision", "s");
const state = el("span", { class: "state" }),
  desired = el("span"),
  note = el("p", { class: "note" });
const pedals = { accelerator: bar("--ok"), brake: bar("--danger") };
const acc = el(
  "div",
  { class: "card acc" },
  el("div", { class: "top" }, el("span", { class: "label", textContent: "ACC" }), state, desired),
  el(
    "div",
    { class: "pedals" },
    el("span", { textContent: "accel" }),
    pedals.accelerator.node,
    pedals.accelerator.value,
    el("span", { textContent: "brake" }),
    pedals.brake.node,
    pedals.brake.value,
  ),
  note,
);

export function setUp() {
  $("#banner").append(lead, distance.card, closing.card, ttc.card, acc);
  on(["frame"], update);
  on(["state"], () => (provisional.hidden = !get("state")?.provisional));
}

/** @param {string} key @param {string} label @param {string} unit */
function figure(key, label, unit) {
  const value = el("span", { textContent: DASH });
  const card = el(
    "div",
    { class: "card", data: { figure: key } },
    el("div", { class: "label", textContent: label }),
    el("div", { class: "value" }, value, el("small", { textContent: unit })),
  );
  return { card, value };
}

/** @param {string} colour */
function bar(colour) {
  const fill = el("i", { style: { "--bar": `var(${colour})` } });
  return { node: el("div", { class: "bar" }, fill), fill, value: el("span") };
}

function update() {
  const result = get("frame")?.result;
  if (!result) return;
  const { cipv } = result;
  const item = result.objects.find(({ id }) => id === cipv?.id);
  mark(lead, "lead", cipv ? "yes" : "no");
  source.hidden = !item;
  if (item) {
    mark(source, "role", roleOf(item, null));
    text(source, item.source);
  }
  text(name, cipv ? `#${cipv.id} ${item?.type ?? "obstacle"}` : "No vehicle in path");
  const accel = accelWords(cipv);
  say(reason, cipv ? [cipv.reason, accel].filter(Boolean).join("; ") : whyNone(result));
  text(distance.value, num(cipv?.distance_m));
  text(closing.value, cipv ? signed(kmh(cipv.closing_speed_mps)) : DASH);
  text(ttc.value, ttcWords(cipv?.ttc_s));
  mark(ttc.card, "alarm", urgencyOf(cipv?.ttc_s));
  updateAcc(result);
}

/** What the lead does to its speed, if that is certain.
 * @param {Cipv|null} cipv */
function accelWords(cipv) {
  const [accel, sigma] = [cipv?.accel_mps2, cipv?.accel_sigma_mps2];
  if (accel == null || sigma == null || Math.abs(accel) < 2 * sigma) return "";
  return `${accel < 0 ? "brakes" : "accelerates"} by ${num(Math.abs(accel))} ± ${num(sigma)} m/s²`;
}

/** @param {Result} result */
function whyNone(result) {
  const n = result.rejected.length;
  return n
    ? `${n} object${n > 1 ? "s" : ""} rejected; see the objects table for reasons.`
    : "No objects in this frame.";
}

/** The source of ego speed, as text. */
const MOTION_WORDS = { can: "CAN", ins: "IMU", gnss: "GNSS", lidar: "LiDAR" };

/** @param {Result} result */
function updateAcc({ acc: command, ego, own_motion: from }) {
  mark(acc, "state", command?.state ?? "off");
  text(state, command ? ACC_WORDS[command.state] : "Off");
  desired.title = from ? `Ego speed: ${MOTION_WORDS[from.speed_from]} ± ${num(from.speed_sigma_mps, 1)} m/s` : "";
  const own = ego ? `${num(kmh(ego.speed_mps), 0)} → ` : "";
  text(desired, command ? `${own}${num(kmh(command.desired_speed_mps), 0)} km/h` : "");
  for (const pedal of /** @type {const} */ (["accelerator", "brake"])) {
    const value = command?.[pedal] ?? null;
    pedals[pedal].fill.style.setProperty("--part", `${100 * (value ?? 0)}%`);
    text(pedals[pedal].value, value === null ? DASH : `${Math.round(100 * value)}%`);
  }
  say(note, command ? command.reason : "Ego speed unknown.");
}

/** Text that may be truncated, repeated as a tooltip. @param {HTMLElement} node @param {string} words */
function say(node, words) {
  if (node.title === words) return;
  text(node, words);
  node.title = words;
}
