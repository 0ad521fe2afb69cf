// A picture's own values, scene-linear half floats, as a layer that can be drawn and measured.

import { call, jobPath } from "../base/api.js";
import { HALF } from "../base/half.js";

const MAGIC = "primrayP";
const HEADER_BYTES = 40;
const [VALUES, ERRORS] = [["R", "G", "B", "A"], ["stderr.R", "stderr.G", "stderr.B"]];

export class BadPreview extends Error {}

// Resolves to the current picture of a job's frame; null is the running frame.
export async function rawOf(job, frame) {
  const which = frame === null ? "" : `&frame=${frame}`;
  const response = await call("GET", jobPath(job, `/preview?format=raw${which}`), { accept: "*/*" });
  return { tag: response.headers.get("etag"), ...decodeRaw(await response.arrayBuffer()) };
}

// Decodes the file of worker/preview.py: magic, version, size, size of the picture, passes, samples; names; planes of half
// floats.
export function decodeRaw(buffer) {
  const bytes = new Uint8Array(buffer);
  const view = new DataView(buffer);
  if (bytes.length < HEADER_BYTES + 1 || String.fromCharCode(...bytes.subarray(0, 8)) !== MAGIC || view.getUint32(8, true) !== 1) {
    throw new BadPreview("The raw preview is not of the version that this page reads; reload the page.");
  }
  const [width, height, fullWidth, fullHeight] = [12, 16, 20, 24].map((at) => view.getUint32(at, true));
  let at = HEADER_BYTES;
  const names = Array.from({ length: bytes[at++] }, () => {
    const length = bytes[at++];
    at += length;
    return String.fromCharCode(...bytes.subarray(at - length, at));
  });
  const count = width * height;
  if (bytes.length !== at + 2 * count * names.length) throw new BadPreview("The raw preview ended early.");
  const halfs = new Uint16Array(buffer.slice(at)); // copied because the names may end at an odd offset; every platform of browsers is little-endian
  const plane = (name) => Float32Array.from(halfs.subarray(names.indexOf(name) * count, (names.indexOf(name) + 1) * count), (bits) => HALF[bits]);
  return {
    kind: "color", key: "raw", label: "Picture", names: VALUES, meaning: "", space: "lin_rec709_scene", isLight: true, ids: null,
    planes: VALUES.map(plane), errors: ERRORS.map(plane),
    width, height, fullWidth, fullHeight, step: Math.ceil(fullWidth / width), isMean: true,
  };
}
