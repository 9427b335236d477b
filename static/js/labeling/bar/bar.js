/** The labeling bar (lead, navigation, save state), and the shortcuts below the timeline. */
import { $, el, keyed, mark, press, text } from "../../core/dom.js";
import { get, on, paint, set } from "../../core/store.js";
import { possible, redo, undo } from "../../panels/undo.js";
import { discard, send } from "../acts/queue.js";
import * as commands from "../acts/commands.js";
import { fill } from "../state/classes.js";
import { present } from "../state/draft.js";
import { isKnown } from "../state/sightings.js";
import { leadAt, leadName, shown, trackOf } from "../state/labels.js";
import { labelKeys } from "../keys.js";
import { withOwn } from "../../keys/own_keys.js";
import { setTool, toggleFollows } from "../state/mode.js";
import { newLabel, setNewLabel } from "../state/new_class.js";
import { askName, hasAccount, shownName } from "../state/person.js";
import * as offer from "./offer.js";
import { markMore, scrolls } from "../../core/scrolled_row.js";
import * as review from "../acts/review.js";
import * as reviewRow from "./review_row.js";
import * as span from "../state/marked_frames.js";
import { besides } from "../state/outcome.js";

/** @typedef {import("../state/types.js").Lead} Lead */

/** The last task whose end was reported, or that ended before this page loaded. @type {number|null} */
let ended = null;
/** Frame of the status message; it is cleared when the user moves on. */
let about = -1;
/** The lead button that was scrolled into view. @type {Element|null} */
let inSight = null;

const where = el("span", { class: "facts where" }),
  leads = el("span", { class: "joined leads", aria: { role: "group", label: "Lead" } });
const saved = el("span", { class: "saved", aria: { role: "status" } }),
  again = el("button", { type: "button", textContent: "Retry", hidden: true, onclick: send }),
  discarded = el("button", {
    type: "button",
    textContent: "Discard",
    title: "Discard unsaved changes",
    hidden: true,
    onclick: discard,
  });
const said = el("span", { class: "facts said", aria: { role: "status" } });
const task = el(
  "span",
  { class: "task", hidden: true },
  el("progress", { max: 1, aria: { label: "Progress" } }),
  el("span", { class: "facts" }),
);
const name = el("button", { type: "button", class: "quiet annotator", title: "Annotator" });
const back = el("button", {
  type: "button",
  class: "icon-button",
  textContent: "↶",
  aria: { label: "Undo your last change" },
  title: "Undo (Ctrl Z)",
  onclick: undo,
});
const forth = el("button", {
  type: "button",
  class: "icon-button",
  textContent: "↷",
  aria: { label: "Redo" },
  title: "Redo (Ctrl Shift Z)",
  onclick: redo,
});
const fresh = el("button", {
  type: "button",
  class: "toggle fresh",
  textContent: "New",
  title: "New label: drag in the plan, drag or click in the image, or press Enter (G)",
  onclick: () => setTool("new"),
});

const follow = el("button", {
  type: "button",
  class: "toggle rarely",
  textContent: "Follow",
  title: "Follow the shared playhead; otherwise this page has its own while labeling",
  onclick: toggleFollows,
});

const reviewToggle = el("button", {
  type: "button",
  class: "toggle",
  textContent: "Review",
  title: "Review labels made by others (Shift R)",
  onclick: review.toggleReview,
});
const kind = el("select", {
  class: "kind",
  aria: { label: "Class of new labels" },
  title: "Class of new labels",
});

export function setUp() {
  on(["classes"], () => {
    fill(kind);
    kind.value = newLabel();
  });
  kind.addEventListener("change", () => {
    setNewLabel(kind.value);
    kind.blur();
  });
  name.addEventListener("click", () => {
    if (!hasAccount()) void askName();
  });
  const next = (/** @type {string} */ words, /** @type {string} */ title, /** @type {commands.Wanted} */ what) =>
    el("button", {
      type: "button",
      class: what === "sent_back" ? "rarely" : "",
      textContent: words,
      title,
      onclick: () => commands.goTo(what, 1),
    });
  $("#label-bar").append(
    el(
      "div",
      { class: "label-row" },
      el("b", { textContent: "Lead" }),
      leads,
      el("b", { textContent: "Next" }),
      el(
        "span",
        { class: "joined", aria: { role: "group", label: "Go to next" } },
        next("Queued", "Next frame queued for labeling (Shift M)", "asked"),
        next("Unlabelled", "Next unlabelled frame (N)", "unlabelled"),
        next("Disagreement", "Next disagreement between labels and pipeline (V)", "disagreement"),
        next("Proposed", "Next proposal (B)", "proposed"),
        next("Sent back", "Next label sent back (Y)", "sent_back"),
      ),
      fresh,
      kind,
      reviewToggle,
      follow,
      el("span", { class: "spacer" }),
      back,
      forth,
      name,
    ),
    el(
      "div",
      { class: "label-row label-line" },
      where,
      reviewRow.row,
      said,
      offer.setUp(),
      task,
      saved,
      again,
      discarded,
    ),
  );
  scrolls(leads);
  showKeys();
  on(["keys", "person"], showKeys);
  paint(["labeling", "labels", "labelFrames", "frame", "track", "marked", "draft", "person"], reflect);
  on(["saving", "said", "link"], reflectSaving);
  on(["state"], reflectTask);
  on(["state", "steps"], () => {
    back.disabled = !possible()?.can_undo;
    forth.disabled = !possible()?.can_redo;
  });
  on(["said"], () => {
    about = get("scrub") ?? shown();
  });
  on(["frame"], () => get("said") && get("scrub") === null && shown() !== about && text(said, ""));
}

function reflect() {
  if (!get("labeling")?.on) return;
  mark($("#label-bar"), "frame", String(shown()));
  if (!isKnown(shown())) return;
  const range = leadAt(shown()),
    marked = get("marked");
  const here = present()
    .map(({ track }) => trackOf(track))
    .filter((track) => track !== null && track.state !== "rejected");
  const numbers = here
    .map((track) => /** @type {import("../state/types.js").LabelTrack} */ (track).id)
    .sort((a, b) => a - b);
  const shownLeads = /** @type {Lead[]} */ ([
    "none",
    "unknown",
    ...(typeof range?.lead === "number" && !numbers.includes(range.lead) ? [range.lead] : []),
    ...numbers,
  ]);
  keyed(
    leads,
    shownLeads,
    String,
    (lead) => el("button", { type: "button", textContent: leadName(lead), onclick: () => span.choose(lead) }),
    (button, lead) => {
      press(button, range?.lead === lead);
      button.classList.toggle("is-proposed", range?.lead === lead && range.state === "proposed");
      button.title =
        range?.lead === lead && range.state === "proposed" && !marked
          ? `Accept it: ${leadName(lead)} in frames ${range.first + 1}–${range.last + 1}`
          : lead === "none"
            ? "No lead (0)"
            : lead === "unknown"
              ? "Lead unclear (U)"
              : `Set #${lead} as lead (type its number)`;
    },
  );
  const pressed = leads.querySelector("[aria-pressed=true]");
  if (pressed !== inSight) pressed?.scrollIntoView({ block: "nearest", inline: "nearest" });
  inSight = pressed;
  markMore(leads);
  const { first, last } = span.span();
  text(
    where,
    marked
      ? `frames ${first + 1}–${last + 1}${marked.typed ? ` · #${marked.typed}…` : ""}`
      : range
        ? rangeWords(range)
        : "lead not labelled",
  );
  press(follow, get("labeling")?.follows === true);
  press(reviewToggle, review.isReviewing());
  reviewRow.reflect();
  press(fresh, get("labeling")?.tool === "new");
  Object.assign(name, { textContent: shownName() || "your name", title: `Annotator: ${shownName()}` });
}

/** @param {import("../state/types.js").LeadRange} range */
function rangeWords({ state, first, last, comment, reviewer }) {
  const frames = `${first + 1}–${last + 1}`;
  if (comment) return `sent back ${frames}: ${comment}`;
  return reviewer ? `reviewed ${frames} by ${reviewer}` : `${state} ${frames}`;
}

function reflectSaving() {
  const saving = get("saving"),
    at = saving?.at_ms ? new Date(saving.at_ms).toLocaleTimeString("en-GB") : "";
  saved.dataset.state = saving?.state ?? "";
  text(
    saved,
    !saving
      ? ""
      : saving.state === "saving"
        ? "saving…"
        : saving.state === "failed"
          ? `not saved: ${saving.problem}`
          : at
            ? `saved ${at}`
            : "",
  );
  again.hidden = discarded.hidden = saving?.state !== "failed";
  text(said, (said.title = get("said") ?? ""));
}

function reflectTask() {
  const state = get("state"),
    current = state?.labels?.task ?? null;
  ended ??= current && !current.running ? current.id : -1;
  const isFailed = Boolean(current?.error) && current?.id !== ended;
  task.hidden = !current?.running && !isFailed;
  task.dataset.failed = String(isFailed);
  if (current && !current.running && !isFailed && current.id !== ended) {
    ended = current.id;
    set("said", besides(said.textContent ?? "", current.note));
  }
  if (!current) return;
  const bar = $("progress", HTMLProgressElement, task);
  bar.hidden = !current.running;
  bar.value = current.total ? current.done / current.total : 0;
  text(
    $(".facts", HTMLElement, task),
    isFailed ? `${current.what} failed: ${current.error}` : `${current.what} ${current.done}/${current.total}`,
  );
}

/** The keys that apply in this mode, below the timeline. */
function showKeys() {
  const bindings = /** @type {import("../keys.js").LabelBinding[]} */ (
    withOwn(labelKeys()).flatMap((group) => group.bindings)
  );
  $("#label-keys").replaceChildren(
    el("span", {}, el("kbd", { textContent: "?" }), " all shortcuts"),
    ...bindings
      .filter(({ brief }) => brief)
      .map(({ shown: keys, brief }) => el("span", {}, el("kbd", { textContent: keys }), ` ${brief}`)),
  );
}
