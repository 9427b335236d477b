/** Disables controls that need a recording while live sensors are shown. */
import { $ } from "../core/dom.js";
import { NO_DRIVE } from "../drive/live_buffer.js";
import { get, on } from "../core/store.js";

/** @type {{part: HTMLButtonElement, title: string}[]} */
let parts = [];
let isLive = false;

export function setUp() {
  const ids = ["#clip-in", "#clip-out", "#export-button", "#event-back", "#event-next"];
  parts = ids.map((id) => $(id, HTMLButtonElement)).map((part) => ({ part, title: part.title }));
  on(["state"], reflect);
}

function reflect() {
  if ((get("state")?.live === true) === isLive) return;
  isLive = !isLive;
  for (const { part, title } of parts) {
    part.disabled = isLive;
    part.title = isLive ? NO_DRIVE : title;
  }
}
