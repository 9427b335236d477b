/** @typedef {import("./types.js").Frame} Frame */

const utf8 = new TextDecoder();
/** @param {number} n */
const pad4 = (n) => (n + 3) & ~3;

/**
 * Decode one binary message (layout: app/streaming/encode.py). Arrays are views into the message, not copies.
 * @param {ArrayBuffer} buffer @returns {{frame: Frame, jpeg: Uint8Array<ArrayBuffer>}}
 */
export function decode(buffer) {
  const headerLength = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(utf8.decode(new Uint8Array(buffer, 4, headerLength)));
  const jpeg = new Uint8Array(buffer, 4 + headerLength, header.picture?.bytes ?? 0);
  const count = header.points;
  let end = 4 + headerLength + pad4(jpeg.length);
  /** Offset of the next array of so many bytes. @param {number} bytes */
  const next = (bytes) => (end += bytes) - bytes;
  const frame = {
    madeUnixMs: header.made_unix_ms,
    detectMs: header.detect_ms,
    state: header.state,
    result: header.result,
    display: header.display,
    row: header.row,
    image: header.picture,
    bitmap: null,
    count,
    xyz: new Int16Array(buffer, next(6 * count), 3 * count),
    uv: new Int16Array(buffer, next(4 * count), 2 * count),
    owner: new Uint16Array(buffer, next(2 * count), count),
    kind: new Uint8Array(buffer, next(count), count),
    intensity: new Uint8Array(buffer, next(count), count),
    ring: new Uint8Array(buffer, next(count), count),
    age: new Uint8Array(buffer, next(count), count),
  };
  return { frame, jpeg };
}
