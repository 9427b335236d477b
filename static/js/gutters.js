/** Panes that can be resized by dragging between them, or with the arrow keys. Sizes are remembered. */
import { $, memory } from "./dom.js";

/** Which custom property a gutter sets, from the pointer's place in the workspace. */
const GUTTERS = {
  camera: { property: "--camera-h", size: (x, y, box) => y - box.top - 6, limits: (box) => [110, box.height - 110] },
  bev: { property: "--bev-w", size: (x, y, box) => box.right - 6 - paramsWidth() - x, limits: (box) => [180, box.width - paramsWidth() - 280] },
  params: { property: "--params-w", size: (x, y, box) => box.right - 6 - x, limits: () => [220, 520] },
};
const STEP_PX = 24;
const workspace = $("#workspace");

export function setUp() {
  for (const [name, size] of Object.entries(memory.read("gutters", {}))) if (GUTTERS[name]) workspace.style.setProperty(GUTTERS[name].property, size);
  for (const gutter of document.querySelectorAll("[data-gutter]")) {
    gutter.addEventListener("pointerdown", (event) => start(gutter, event));
    gutter.addEventListener("keydown", (event) => nudge(gutter, event));
    gutter.addEventListener("dblclick", () => forget(gutter.dataset.gutter));
  }
}

function paramsWidth() {
  const params = $("#params");
  return getComputedStyle(params).position === "fixed" ? 0 : params.offsetWidth + 6;
}

function start(gutter, event) {
  gutter.setPointerCapture(event.pointerId);
  gutter.classList.add("dragging");
  const move = ({ clientX, clientY }) => place(gutter.dataset.gutter, clientX, clientY);
  gutter.addEventListener("pointermove", move);
  const end = () => {
    gutter.removeEventListener("pointermove", move);
    gutter.classList.remove("dragging");
  };
  gutter.addEventListener("pointerup", end, { once: true });
  gutter.addEventListener("pointercancel", end, { once: true });
}

function nudge(gutter, event) {
  const by = { ArrowLeft: [-STEP_PX, 0], ArrowRight: [STEP_PX, 0], ArrowUp: [0, -STEP_PX], ArrowDown: [0, STEP_PX] }[event.key];
  if (!by) return;
  event.preventDefault();
  event.stopPropagation();
  const box = gutter.getBoundingClientRect();
  place(gutter.dataset.gutter, box.left + box.width / 2 + by[0], box.top + box.height / 2 + by[1]);
}

function place(name, x, y) {
  const box = workspace.getBoundingClientRect();
  const { property, size, limits } = GUTTERS[name];
  const [low, high] = limits(box);
  const value = `${Math.round(Math.min(Math.max(size(x, y, box), low), high))}px`;
  workspace.style.setProperty(property, value);
  memory.write("gutters", { ...memory.read("gutters", {}), [name]: value });
}

function forget(name) {
  workspace.style.removeProperty(GUTTERS[name].property);
  const { [name]: _, ...rest } = memory.read("gutters", {});
  memory.write("gutters", rest);
}
