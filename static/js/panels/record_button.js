/** The button that records sensor data and results into a session. */
import { request } from "../core/api.js";
import { el, press, text } from "../core/dom.js";
import { clock } from "../core/format.js";
import { get, on } from "../core/store.js";

let problem = "";

/** @returns {HTMLElement} for the transport */
export function recordButton() {
  const words = el("span", { textContent: "Record" });
  const button = el(
    "button",
    { type: "button", class: "record toggle", onclick: toggle },
    el("i", { aria: { hidden: "true" } }),
    words,
  );
  on(["state"], () => show(button, words));
  return button;
}

const isOn = () => Boolean(get("state")?.recording) && !get("state")?.recording?.error;

function toggle() {
  problem = "";
  request("api/recording", "POST", { on: !isOn() }).catch((error) => (problem = error.message));
}

/** @param {import("../core/types.js").RecordingState} recording */
const why = ({ dropped, dropped_because }) => (dropped ? `. ${dropped} items were lost: ${dropped_because}` : "");

/** @param {HTMLElement} button @param {HTMLElement} words */
function show(button, words) {
  const recording = get("state")?.recording;
  press(button, isOn());
  const lost = recording?.dropped ? ` · ${recording.dropped} lost` : "";
  text(words, isOn() && recording ? `${clock(recording.seconds)}${lost}` : "Record");
  button.title =
    recording?.error ??
    (problem || (recording ? `Recording into ${recording.file}; click to stop${why(recording)}` : "Record a session"));
  button.setAttribute("aria-label", isOn() ? "Stop recording" : "Record");
}
