/** The answer, large: which vehicle, how far, how fast the gap shrinks, how long that lasts, and what ACC makes of it. */
import { get, on } from "./store.js";
import { $, el, mark, text } from "./dom.js";
import { DASH, kmh, num, signed } from "./format.js";
import { addStrip } from "./trends.js";

const TTC_DANGER_S = 2.5, TTC_WARN_S = 5;
const ACC_WORDS = {
  cruise: "Cruise", follow: "Follow", stop: "Stop", warn: "Warn", partial_brake: "Partial brake", full_brake: "Full brake",
};

const parts = {};

export function setUp() {
  $("#banner").append(lead(), figure("distance", "Distance", "m"), figure("closing", "Closing speed", "km/h"), figure("ttc", "Time to collision", "s"), acc());
  on(["frame"], update);
}

function lead() {
  parts.source = el("span", { class: "pill" });
  parts.name = el("span");
  parts.title = el("div", { class: "title", aria: { live: "polite" } }, parts.source, parts.name);
  parts.reason = el("p", { class: "reason" });
  return (parts.lead = el("div", { class: "card lead" }, parts.title, parts.reason));
}

function figure(key, label, unit) {
  const value = el("span", { textContent: DASH });
  const canvas = el("canvas", { title: `${label} over the recording; click to go there`, aria: { hidden: "true" } });
  addStrip(key, canvas);
  const card = el("div", { class: "card", data: { figure: key } }, el("div", { class: "label", textContent: label }),
    el("div", { class: "value" }, value, el("small", { textContent: unit })), canvas);
  parts[key] = { card, value };
  return card;
}

function acc() {
  parts.state = el("span", { class: "state" });
  parts.desired = el("span");
  parts.accelerator = bar("--ok");
  parts.brake = bar("--danger");
  parts.accNote = el("p", { class: "note" });
  return (parts.acc = el("div", { class: "card acc" },
    el("div", { class: "top" }, el("span", { class: "label", textContent: "ACC" }), parts.state, parts.desired),
    el("div", { class: "pedals" }, el("span", { textContent: "accel" }), parts.accelerator.node, parts.accelerator.value,
      el("span", { textContent: "brake" }), parts.brake.node, parts.brake.value), parts.accNote));
}

function bar(color) {
  const fill = el("i", { style: { "--bar": `var(${color})` } });
  return { node: el("div", { class: "bar" }, fill), fill, value: el("span") };
}

function update() {
  const { result } = get("frame");
  const { cipv } = result;
  const item = cipv && result.objects.find(({ id }) => id === cipv.id);
  mark(parts.lead, "lead", cipv ? "yes" : "no");
  parts.source.hidden = !item;
  if (item) {
    mark(parts.source, "source", item.source);
    text(parts.source, item.source);
  }
  text(parts.name, cipv ? `#${cipv.id} ${item?.type ?? "obstacle"}` : "No vehicle in path");
  text(parts.reason, cipv ? cipv.reason : whyNone(result));
  parts.reason.title = parts.reason.textContent;
  text(parts.distance.value, num(cipv?.distance_m));
  text(parts.closing.value, cipv ? signed(kmh(cipv.closing_speed_mps)) : DASH);
  text(parts.ttc.value, num(cipv?.ttc_s));
  const ttc = cipv?.ttc_s ?? Infinity;
  mark(parts.ttc.card, "alarm", ttc < TTC_DANGER_S ? "danger" : ttc < TTC_WARN_S ? "warn" : "none");
  updateAcc(result);
}

function whyNone(result) {
  const n = result.rejected.length;
  return n ? `${n} object${n > 1 ? "s" : ""} considered; the reasons are in the table.` : "Nothing was seen in this frame.";
}

function updateAcc({ acc, ego }) {
  mark(parts.acc, "state", acc?.state ?? "off");
  text(parts.state, acc ? ACC_WORDS[acc.state] : "Off");
  const own = ego ? `${num(kmh(ego.speed_mps), 0)} → ` : "";
  text(parts.desired, acc ? `${own}${num(kmh(acc.desired_speed_mps), 0)} km/h` : "");
  for (const pedal of ["accelerator", "brake"]) {
    const value = acc?.[pedal] ?? null;
    parts[pedal].fill.style.setProperty("--part", `${100 * (value ?? 0)}%`);
    text(parts[pedal].value, value === null ? DASH : `${Math.round(100 * value)} %`);
  }
  text(parts.accNote, acc ? acc.reason : "Own speed is unknown in this recording.");
  parts.accNote.title = parts.accNote.textContent;
}
