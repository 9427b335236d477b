/** Why the selected object (or else the CIPV) is what it is: its reason and every gate with number and limit. */
import { $, el } from "./dom.js";
import { DASH, num } from "./format.js";
import { get, paint } from "./store.js";

const panel = $("#why");

export function setUp() {
  paint(["frame", "selection"], update);
}

function update() {
  const frame = get("frame");
  if (!frame) return;
  const { objects, cipv, rejected } = frame.result;
  const id = get("selection") ?? cipv?.id ?? null;
  if (id === null) return panel.replaceChildren(el("p", { class: "facts", textContent: "Select an object here, in the camera or in the plan to see its gates." }));
  const item = objects.find((o) => o.id === id);
  if (!item) return panel.replaceChildren(el("p", { class: "facts", textContent: `#${id} is not in this frame.` }));
  const isLead = cipv?.id === id;
  const reason = isLead ? cipv.reason : rejected.find((r) => r.id === id)?.reason ?? "";
  panel.replaceChildren(
    el("div", { class: "line" }, el("b", { textContent: `#${id}` }), el("span", { class: "pill", data: { source: item.source }, textContent: item.source }),
      isLead ? el("span", { class: "pill cipv", textContent: "CIPV" }) : null, el("span", { textContent: reason })),
    el("div", { class: "gates" }, ...item.gates.map(gate)));
}

/** @param {import("./types.js").Gate} g */
function gate(g) {
  const value = g.value === null ? DASH : num(g.value, digits(g.value));
  const limit = g.limit === null ? DASH : num(g.limit, digits(g.limit));
  const title = `${g.value === null ? "nothing to test" : `value ${value}`}, limit ${limit}: ${g.passed ? "passed" : "failed"}`;
  return el("span", { class: "gate", title, data: { passed: g.passed ? "yes" : "no" } },
    el("b", { textContent: g.name.replaceAll("_", " ") }), ` ${value} `, el("span", { textContent: `/ ${limit}` }));
}

const digits = (value) => (Number.isInteger(value) ? 0 : Math.abs(value) < 10 ? 2 : 1);
