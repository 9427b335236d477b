/** @typedef {import("./types.js").Frame} Frame */

const utf8 = new TextDecoder();
const pad4 = (n) => (n + 3) & ~3;

/**
 * Take one binary message apart (layout: app/encode.py). Arrays are views into the message, not copies.
 * @param {ArrayBuffer} buffer @returns {{frame: Frame, jpeg: Uint8Array}}
 */
export function decode(buffer) {
  const headerLength = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(utf8.decode(new Uint8Array(buffer, 4, headerLength)));
  const jpeg = new Uint8Array(buffer, 4 + headerLength, header.picture?.bytes ?? 0);
  const n = header.points;
  let at = 4 + headerLength + pad4(jpeg.length);
  const xyz = new Int16Array(buffer, at, 3 * n);
  const uv = new Int16Array(buffer, (at += 6 * n), 2 * n);
  const owner = new Uint16Array(buffer, (at += 4 * n), n);
  const kind = new Uint8Array(buffer, (at += 2 * n), n);
  const frame = {
    madeUnixMs: header.made_unix_ms, detectMs: header.detect_ms, state: header.state, result: header.result,
    display: header.display, picture: header.picture, bitmap: null, count: n, xyz, uv, owner, kind,
  };
  return { frame, jpeg };
}
