/** Layer toggles and point colours of the views, stored in this browser. */
import { $, el, memory, press } from "../core/dom.js";
import { COLOR_BY } from "./drawing/point_colors.js";
import { get, on, set } from "../core/store.js";
import { toggleTape } from "./measuring_tape.js";

/** @typedef {"camera"|"plan"} View */
/** @type {Record<View, [string, string, string, string][]>} key, label, what it is, palette role; by view */
const CHIPS = {
  camera: [
    ["points", "Points", "LiDAR points projected into the image", "path"],
    ["cuboids", "Cuboids", "Cuboids of LiDAR objects", "lidar"],
    ["lidarBoxes", "L boxes", "LiDAR boxes in the image, as used by fusion", "lidar"],
    ["visionBoxes", "V boxes", "Tracked detector boxes", "vision"],
    ["farView", "Far", "Windows in which the detector, and at times the lane network, look at more detail", "vision"],
    ["path", "Path", "Path corridor on the ground", "path"],
    ["lanes", "Lanes", "Estimated ego-lane lines", "lane"],
  ],
  plan: [
    ["planPoints", "Points", "LiDAR points", "cluster"],
    ["velocity", "Motion", "Relative motion over the next second", "fused"],
    ["trails", "Trails", "Relative positions over the last 3 seconds", "fused"],
    [
      "planPath",
      "Path",
      "Path corridor with 1σ of its edges, ego-lane lines, and the edges, drivable area and vehicles it follows",
      "path",
    ],
  ],
};
const DEFAULTS = {
  points: true,
  cuboids: true,
  lidarBoxes: false,
  visionBoxes: true,
  farView: true,
  path: true,
  lanes: true,
  planPoints: true,
  velocity: true,
  trails: false,
  planPath: true,
};
/** @type {Record<View, import("./drawing/point_colors.js").ColorBy>} */
const DEFAULT_COLORS = { camera: "range", plan: "object" };
/** Containers of a view's chips and tools. @type {Record<View, [string, string]>} */
const PLACES = { camera: ["#camera-layers", "#camera"], plan: ["#bev-layers", "#bev"] };

export function setUp() {
  set("layers", { ...DEFAULTS, ...memory.read("layers", {}) });
  set("colorBy", { ...DEFAULT_COLORS, ...memory.read("colorBy", {}) });
  for (const view of /** @type {View[]} */ (["camera", "plan"])) {
    const buttons = CHIPS[view].map(([key, label, title, role]) =>
      el(
        "button",
        {
          type: "button",
          title,
          data: { layer: key },
          style: { "--chip": `var(--cipv-${role})` },
          onclick: () => toggle(key),
        },
        label,
      ),
    );
    const [bar, canvas] = PLACES[view];
    $(bar).append(...buttons);
    $(canvas).after(
      el(
        "div",
        { class: "view-tools", data: { view }, aria: { role: "group", label: `${view} tools` } },
        colorChoice(view),
        tapeButton(),
      ),
    );
  }
  on(["layers"], reflect);
  on(["frame"], showLaneChip);
  on(["frame"], showPossible);
  reflect();
}

/** Add a tool to a view. @param {View} view @param {HTMLElement} tool */
export function addTool(view, tool) {
  $(`.view-tools[data-view=${view}]`).append(tool);
}

/** @param {string} key */
export function toggle(key) {
  const held = get("layers") ?? {};
  const layers = { ...held, [key]: !held[key] };
  memory.write("layers", layers);
  set("layers", layers);
}

function reflect() {
  for (const button of document.querySelectorAll("[data-layer]"))
    press(button, get("layers")?.[/** @type {HTMLElement} */ (button).dataset.layer ?? ""] === true);
}

/** The lanes chip is shown only with a lane detector. */
function showLaneChip() {
  const hasLanes = Boolean(get("frame")?.display.plan_lanes),
    chip = $("[data-layer=lanes]");
  if (chip.hidden === hasLanes) chip.hidden = !hasLanes;
}

/** What a recording must have for each of these parts of the page. @type {Record<"image"|"points", string>} */
const PARTS = {
  image: "#camera-layers, .view-tools[data-view=camera]",
  points: ["points", "cuboids", "lidarBoxes", "planPoints"].map((key) => `[data-layer=${key}]`).join() + ", .color-by",
};
/** Addresses of the last recording of which an image, or LiDAR points, were seen. @type {Partial<typeof PARTS>} */
const seen = {};

/** Chips and tools are hidden until the recording has what they are about; a frame without it does not hide them. */
function showPossible() {
  const uri = get("state")?.uri ?? "",
    frame = get("frame");
  if (!frame) return;
  if (frame.image) seen.image = uri;
  if (frame.count) seen.points = uri;
  for (const need of /** @type {(keyof typeof PARTS)[]} */ (["image", "points"])) {
    for (const part of document.querySelectorAll(PARTS[need])) {
      const isHidden = seen[need] !== uri,
        each = /** @type {HTMLElement} */ (part);
      if (each.hidden !== isHidden) each.hidden = isHidden;
    }
  }
}

/** @param {View} view */
function colorChoice(view) {
  const options = COLOR_BY.map(([by, label, title]) => el("option", { value: by, textContent: label, title }));
  const choice = el(
    "select",
    { class: "color-by", aria: { label: `Colour ${view} points by` }, title: "Colour points by" },
    ...options,
  );
  const show = () => (choice.value = get("colorBy")?.[view] ?? DEFAULT_COLORS[view]);
  choice.addEventListener("change", () => {
    const chosen = { ...DEFAULT_COLORS, ...get("colorBy"), [view]: choice.value };
    memory.write("colorBy", chosen);
    set("colorBy", chosen);
    choice.blur();
  });
  on(["colorBy"], show);
  show();
  return choice;
}

function tapeButton() {
  const button = el("button", {
    type: "button",
    textContent: "Tape",
    title: "Measuring tape: drag between two points (or Shift + drag)",
    onclick: toggleTape,
  });
  on(["taping"], () => press(button, get("taping") === true));
  press(button, false);
  return button;
}
