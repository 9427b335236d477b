/** The projects: how far each is, what it took each person, and for reviewers how well they labelled control frames. */
import { request } from "../../core/api.js";
import { el } from "../../core/dom.js";
import { mayReview } from "../state/person.js";

/**
 * @typedef {{name: string, sampling: string, drives: number, done: number, frames: number, labelled: number,
 *   sampled: number, asked: number, people: Effort[]}} Project An entry of `/api/labels/projects`.
 * @typedef {{person: string, acts: number, active_s: number, acts_per_frame: number, s_per_frame: number}} Effort
 * @typedef {{project: string, title: string, person: string, first: number, last: number, leads: number,
 *   lead_share: number|null, vehicles: number, missed: number, extra: number, iou: number|null}} ControlResult
 */

/** The project whose recordings are shown; empty for all. */
let chosen = "";

const list = el("div", { class: "projects", aria: { label: "Projects" }, hidden: true });
const filter = el("select", { aria: { label: "Project" } });

/** @param {HTMLElement} parent @param {() => void} again shows the queue anew */
export function setUp(parent, again) {
  filter.addEventListener("change", () => {
    chosen = filter.value;
    again();
  });
  parent.append(list, filter);
  filter.hidden = true;
}

/** Whether a recording of this project is shown. @param {string} project */
export const isShown = (project) => !chosen || project === chosen;

export async function look() {
  /** @type {Project[]} */
  const projects = await request("api/labels/projects");
  /** @type {ControlResult[]} */
  const control = projects.length && mayReview() ? await request("api/labels/control") : [];
  if (!projects.some(({ name }) => name === chosen)) chosen = "";
  filter.replaceChildren(
    el("option", { value: "", textContent: "All recordings" }),
    ...projects.map(({ name }) => el("option", { value: name, textContent: `Only ${name}` })),
  );
  filter.value = chosen;
  filter.hidden = list.hidden = !projects.length;
  list.replaceChildren(
    ...projects.map((project) =>
      row(
        project,
        control.filter((each) => each.project === project.name),
      ),
    ),
  );
}

/** @param {Project} project @param {ControlResult[]} control */
function row(project, control) {
  const { name, sampling, drives, done, frames, labelled, sampled, asked, people } = project;
  const isSampled = sampled > 0;
  const bar = el("progress", {
    max: isSampled ? sampled : Math.max(frames, 1),
    value: isSampled ? sampled - asked : labelled * frames,
    aria: { label: `Progress of ${name}` },
  });
  const progress = isSampled
    ? `${sampled - asked} of ${sampled} queued frames labelled`
    : `lead labelled in ${Math.round(100 * labelled)} % of ${frames} frames`;
  return el(
    "div",
    { class: "project-row", data: { project: name } },
    el("b", { textContent: name }),
    bar,
    facts(`${progress} · ${done} of ${drives} recordings done${sampling ? ` · ${sampling}` : ""}`),
    ...people.map(({ person, acts, active_s, acts_per_frame, s_per_frame }) =>
      facts(
        `${person}: ${acts} ${acts === 1 ? "change" : "changes"} (${acts_per_frame.toFixed(1)} a frame), ` +
          `${Math.round(active_s / 60)} min (${s_per_frame.toFixed(1)} s a frame)`,
      ),
    ),
    ...control.map(controlFacts),
  );
}

/** @param {ControlResult} result */
function controlFacts({ title, person, first, last, leads, lead_share, vehicles, missed, extra, iou }) {
  const lead = lead_share === null ? "no leads" : `lead right in ${Math.round(100 * lead_share)} % of ${leads} frames`;
  const overlap = iou === null ? "" : `, IoU ${iou.toFixed(2)}`;
  return facts(
    `Control frames ${first + 1}–${last + 1} of ${title}: ${person}: ${lead}, cuboids ${vehicles} right, ` +
      `${missed} missed, ${extra} extra${overlap}`,
  );
}

/** @param {string} words */
const facts = (words) => el("p", { class: "facts", textContent: words });
