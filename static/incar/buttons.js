/** The Record and Mark buttons. Every press gets a written response, including failures. */
import { request } from "../js/core/api.js";
import { $, mark, press, text } from "../js/core/dom.js";
import { clock } from "../js/core/format.js";
import { get, on } from "../js/core/store.js";

const ANSWER_MS = 4000,
  PATIENCE_MS = 5000;
const record = $("#record"),
  marking = $("#mark"),
  words = $("#record span"),
  answer = $("#answer");
let hiding = 0;

export function setUp() {
  record.addEventListener("click", toggleRecording);
  marking.addEventListener("click", markMoment);
  on(["state"], show);
}

const isOn = () => Boolean(get("state")?.recording) && !get("state")?.recording?.error;

function toggleRecording() {
  const begins = !isOn();
  ask(
    request("api/recording", "POST", { on: begins }),
    () => (begins ? "Recording" : "Recording saved"),
    begins ? "Recording failed" : "Not saved",
  );
}

function markMoment() {
  ask(request("api/marks", "POST", { text: "" }), marked, "Mark failed");
}

/**
 * Live sensors have no frame numbers to seek to, so their marks are stored by time.
 * @param {{index: number, t_s: number, in_session: boolean}} made
 */
function marked({ index, t_s, in_session }) {
  if (!get("state")?.live) return `Marked, frame ${index + 1}`;
  return `Marked at ${clock(t_s)}${in_session ? "" : ", not recorded"}`;
}

/** @param {Promise<any>} asked @param {(given: any) => string} done @param {string} refused */
async function ask(asked, done, refused) {
  const late = new Promise((_, reject) => setTimeout(() => reject(new Error("no response from server")), PATIENCE_MS));
  try {
    say(done(await Promise.race([asked, late])), "done");
  } catch (error) {
    // the browser's own error message for a lost connection means nothing to a driver
    say(
      `${refused}: ${error instanceof TypeError ? "no connection" : error instanceof Error ? error.message : error}`,
      "refused",
    );
  }
}

/** @param {string} sentence @param {"done"|"refused"} kind */
function say(sentence, kind) {
  mark(answer, "kind", kind);
  text(answer, `${kind === "done" ? "✓" : "✕"} ${sentence}`);
  answer.hidden = false;
  clearTimeout(hiding);
  hiding = setTimeout(() => (answer.hidden = true), ANSWER_MS);
}

let toldError = "";

function show() {
  const recording = get("state")?.recording;
  press(record, isOn());
  text(
    words,
    isOn() && recording ? `${clock(recording.seconds)}${recording.dropped ? ` −${recording.dropped}` : ""}` : "Record",
  );
  record.setAttribute("aria-label", isOn() ? "Stop recording" : "Record");
  if (recording?.error && recording.error !== toldError) say(recording.error, "refused");
  toldError = recording?.error ?? "";
}
