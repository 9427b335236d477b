/** The frame stream: keeps only the newest frame, reconnects forever and tracks the server's clock. */
import { decode } from "./protocol.js";
import { drawNow, get, set } from "./store.js";

const PING_MS = 2000;
const RETRY_MS = [300, 600, 1200, 2500, 5000];
/** The server scales images in steps of this width (app/streaming/sent_image.py). */
const WIDTH_STEP_PX = 160;

/**
 * Without any message for this long, not even a pong, the connection counts as lost.
 */
const SILENT_MS = 3 * PING_MS;

/** Server clock minus local clock, milliseconds; null until known. @type {number|null} */
let clockOffset = null;
let attempts = 0;
let lastSequence = -1;
let isFirst = true;
/** Messages received so far: the newer of a frame's state and a separate state message wins. */
let received = 0;
let stateNumber = 0;
/** @typedef {{buffer: ArrayBuffer, number: number, done: () => void}} Received */
/** @type {Received|null} */
let waiting = null;
let decoding = false;
/** JPEG of the current frame. @type {Uint8Array<ArrayBuffer>} */
let shownJpeg = new Uint8Array();
/** @type {WebSocket|null} */
let socket = null;
/** What the server knows about this page. @type {Map<string, Told>} */
const told = new Map();

/** The server's clock now, Unix milliseconds. */
export function serverNow() {
  return Date.now() + (clockOffset ?? 0);
}

/** Whether the server's clock is known; until then the local clock is used. */
export const isClockKnown = () => clockOffset !== null;

/** Tell the server the displayed image width, so that it sends no larger one. @param {number} width device pixels */
export function showImageAt(width) {
  const steps = Math.ceil(width / WIDTH_STEP_PX);
  if (steps > 0) tell("picture_px", steps * WIDTH_STEP_PX);
}

/** @typedef {number|boolean|string|null|object} Told */

/** Tell the server something about this page, now and after each reconnection. Sent only when the value changes.
 * @param {string} name @param {Told} value */
export function tell(name, value) {
  if (JSON.stringify(told.get(name)) === JSON.stringify(value)) return;
  told.set(name, value);
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ [name]: value }));
}

/** @type {(state: import("./types.js").State) => import("./types.js").State} */
let patch = (state) => state;

/** Values that this page has set and the server may not know yet. @param {typeof patch} how */
export function patchState(how) {
  patch = how;
}

export function connect() {
  const url = new URL("../../api/stream?paced=1", import.meta.url);
  const width = told.get("picture_px");
  if (width) url.searchParams.set("picture_px", String(width));
  const own = told.get("own");
  if (typeof own === "number") url.searchParams.set("own", String(own));
  url.protocol = url.protocol.replace("http", "ws");
  const opened = new WebSocket(url);
  socket = opened;
  opened.binaryType = "arraybuffer";
  /** When the oldest unanswered request was sent; null if none is pending. @type {number|null} */
  let owedSince = performance.now();
  const ping = () => {
    if (owedSince !== null && performance.now() - owedSince > SILENT_MS) return lose();
    if (opened.readyState !== WebSocket.OPEN) return;
    owedSince ??= performance.now();
    opened.send(JSON.stringify({ ping: Date.now() }));
  };
  const pinging = setInterval(ping, PING_MS);
  const lose = () => {
    opened.onopen = opened.onmessage = opened.onclose = null;
    opened.close(); // without a network, closing takes long; do not wait
    clearInterval(pinging);
    if (attempts === 0) set("link", { status: "lost", since: Date.now() });
    setTimeout(connect, RETRY_MS[Math.min(attempts++, RETRY_MS.length - 1)]);
  };
  opened.onclose = lose;
  opened.onopen = () => {
    attempts = 0;
    lastSequence = -1;
    isFirst = true;
    set("link", { status: "live", since: Date.now() });
    ping();
    if (told.size) opened.send(JSON.stringify(Object.fromEntries(told)));
  };
  const done = () => opened.readyState === WebSocket.OPEN && opened.send('{"painted":true}');
  opened.onmessage = ({ data }) => {
    owedSince = null;
    const number = ++received;
    if (typeof data === "string") onText(JSON.parse(data), number);
    else onBinary({ buffer: data, number, done });
  };
}

/**
 * @typedef
 *   {{type: string, state: import("./types.js").State, id: number|null, ping: number, server_unix_ms: number} &
 *   import("../labeling/views/three.js").Dragged}
 *   Message
 */
/** @param {Message} message @param {number} number */
function onText(message, number) {
  if (message.type === "state") {
    stateNumber = number;
    set("state", patch(message.state));
  }
  if (message.type === "held") set("dragged", message);
  if (message.type === "selected") set("selection", message.id);
  if (message.type === "pong") clockOffset = message.server_unix_ms - (Date.now() + message.ping) / 2;
}

/** Keep only the newest message while an image is being decoded. @param {Received} message */
async function onBinary(message) {
  waiting?.done();
  waiting = message;
  if (decoding) return;
  decoding = true;
  while (waiting) {
    const next = waiting;
    waiting = null;
    await show(next).catch((error) => {
      console.error("a frame could not be shown", error);
      next.done();
    });
  }
  decoding = false;
}

/** @param {Received} message */
async function show({ buffer, number, done }) {
  const { frame, jpeg } = decode(buffer);
  if (frame.state.sequence < lastSequence) return done();
  frame.isLate = isFirst || frame.state.sequence === lastSequence; // resent, for example with a wider image
  lastSequence = frame.state.sequence;
  isFirst = false;
  const before = get("frame");
  if (jpeg.length) frame.bitmap = (isSame(jpeg, shownJpeg) && before?.bitmap) || (await bitmapOf(jpeg));
  shownJpeg = jpeg;
  if (number > stateNumber) {
    stateNumber = number;
    set("state", patch(frame.state));
  }
  set("frame", frame);
  drawNow();
  requestAnimationFrame(() => {
    if (before?.bitmap !== frame.bitmap) before?.bitmap?.close();
    done();
  });
}

/** @param {Uint8Array<ArrayBuffer>} jpeg @returns {Promise<ImageBitmap|null>} null if it cannot be decoded */
const bitmapOf = (jpeg) => createImageBitmap(new Blob([jpeg], { type: "image/jpeg" })).catch(() => null);

/** Whether two JPEGs are identical, as when a parameter changes on a paused frame.
 * @param {Uint8Array} jpeg @param {Uint8Array} shown */
function isSame(jpeg, shown) {
  return jpeg.length === shown.length && jpeg.every((byte, i) => byte === shown[i]);
}
