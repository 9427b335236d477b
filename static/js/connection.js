/** The stream: newest frame in, reconnecting for ever, and the server's clock. */
import { decode } from "./protocol.js";
import { set } from "./store.js";

const PING_MS = 2000;
const RETRY_MS = [300, 600, 1200, 2500, 5000];

/** Server clock minus ours, milliseconds. */
let clockOffset = 0;
let attempts = 0;
let lastSequence = -1;
let isFirst = true;
/** @typedef {{buffer: ArrayBuffer, done: () => void}} Received */
/** @type {Received|null} */
let waiting = null;
let decoding = false;

/** The server's clock now, Unix milliseconds. */
export function serverNow() {
  return Date.now() + clockOffset;
}

export function connect() {
  const url = new URL("api/stream?paced=1", location.href);
  url.protocol = url.protocol.replace("http", "ws");
  const socket = new WebSocket(url);
  socket.binaryType = "arraybuffer";
  let pinging = 0;
  socket.onopen = () => {
    attempts = 0;
    lastSequence = -1;
    isFirst = true;
    set("link", { status: "live", since: Date.now() });
    const ping = () => socket.send(JSON.stringify({ ping: Date.now() }));
    ping();
    pinging = setInterval(ping, PING_MS);
  };
  const done = () => socket.readyState === WebSocket.OPEN && socket.send('{"painted":true}');
  socket.onmessage = ({ data }) => (typeof data === "string" ? onText(JSON.parse(data)) : onBinary({ buffer: data, done }));
  socket.onclose = () => {
    clearInterval(pinging);
    if (attempts === 0) set("link", { status: "lost", since: Date.now() });
    setTimeout(connect, RETRY_MS[Math.min(attempts++, RETRY_MS.length - 1)]);
  };
}

function onText(message) {
  if (message.type === "state") set("state", message.state);
  if (message.type === "pong") clockOffset = message.server_unix_ms - (Date.now() + message.ping) / 2;
}

/** Keep only the newest message while a picture is being decoded. @param {Received} received */
async function onBinary(received) {
  waiting?.done();
  waiting = received;
  if (decoding) return;
  decoding = true;
  while (waiting) {
    const next = waiting;
    waiting = null;
    await show(next);
  }
  decoding = false;
}

/** @param {Received} received */
async function show({ buffer, done }) {
  const { frame, jpeg } = decode(buffer);
  if (frame.state.sequence < lastSequence) return done();
  lastSequence = frame.state.sequence;
  frame.isLate = isFirst;
  isFirst = false;
  if (jpeg.length) frame.bitmap = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" })).catch(() => null);
  set("frame", frame);
  requestAnimationFrame(done);
}
