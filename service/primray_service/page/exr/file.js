// Reads an OpenEXR file on the server by ranges: its headers, then only the bytes of the parts that are shown.

import { call } from "../base/api.js";
import { BadExr, NeedsMore, readHeaders } from "./header.js";
import { planesOf } from "./planes.js";

const FIRST_BYTES = 2 ** 16;
const MOST_HEADER = 2 ** 25; // manifests of Cryptomattes are long
const MOST_PART = 2 ** 29;
const KEPT = 2 ** 28; // bytes of planes, of the parts that were shown last

// `range(begin, end)` resolves to those bytes of a file of `size` bytes, which does not change.
export async function openExr(range, size) {
  const { head, found } = await headers(range, size);
  const tables = found.parts.map((part) => 8 * part.chunks);
  const whole = found.end + tables.reduce((sum, bytes) => sum + bytes, 0);
  const buffer = whole <= head.byteLength ? head : await range(0, whole);
  const view = new DataView(buffer);
  let at = found.end;
  const parts = found.parts.map((part, number) => {
    const offsets = Array.from({ length: part.chunks }, (_, chunk) => Number(view.getBigUint64(at + 8 * chunk, true)));
    at += tables[number];
    return { ...part, offsets };
  });
  const starts = parts.flatMap(({ offsets }) => offsets).concat(size).sort((a, b) => a - b);
  const read = new Map(); // {reading, bytes} by the part's number, least recently shown first

  // Resolves to {step, width, height, planes} of the part of this number.
  function planes(number) {
    const before = read.get(number);
    read.delete(number);
    const entry = before ?? { reading: load(parts[number]), bytes: 0 };
    read.set(number, entry);
    if (!before) entry.reading.then((found) => keep(entry, found), () => read.get(number) === entry && read.delete(number));
    return entry.reading;
  }

  function keep(entry, { planes }) {
    entry.bytes = planes.reduce((sum, { byteLength }) => sum + byteLength, 0);
    let sum = [...read.values()].reduce((bytes, each) => bytes + each.bytes, 0);
    for (const [number, each] of read) {
      if (sum <= KEPT) return;
      if (each === entry) continue;
      sum -= each.bytes;
      read.delete(number);
    }
  }

  async function load(part) {
    const begin = Math.min(...part.offsets.filter((offset) => offset > 0));
    const last = Math.max(...part.offsets);
    const end = starts.find((start) => start > last) ?? size;
    if (!(end - begin <= MOST_PART)) throw new BadExr("This part is too large to be shown here; download the file.");
    const bytes = new Uint8Array(await range(begin, end));
    const data = new DataView(bytes.buffer);
    const lead = found.isMultipart ? 4 : 0; // the part's number
    return planesOf(part, (chunk) => {
      if (part.offsets[chunk] === 0) return null; // never written
      const place = part.offsets[chunk] - begin + lead + 4; // its first row
      return bytes.subarray(place + 4, place + 4 + data.getUint32(place, true));
    });
  }

  return { parts, planes };
}

async function headers(range, size) {
  for (let count = FIRST_BYTES; ; count *= 8) {
    const head = await range(0, Math.min(count, size));
    try {
      return { head, found: readHeaders(head) };
    } catch (failure) {
      if (!(failure instanceof NeedsMore)) throw failure;
      if (count >= size || count >= MOST_HEADER) throw new BadExr("The file's headers have no end.");
    }
  }
}

// Reads ranges of the file at a URL.
export const rangesOf = (url, signal) => async (begin, end) => {
  const response = await call("GET", url, { accept: "*/*", headers: { range: `bytes=${begin}-${end - 1}` }, signal });
  const buffer = await response.arrayBuffer();
  // A server may answer with the whole file.
  return response.status === 206 ? buffer : buffer.slice(begin, end);
};
