// Decodes chunks of scanlines to planes of numbers, a Float32Array or Uint32Array for each channel. Rows and columns of very
// large parts are skipped at regular steps, since a screen shows no more.

import { HALF } from "../base/half.js";
import { BadExr } from "./header.js";

const MOST_KEPT = 2 ** 22; // pixels
const BYTES = { uint: 4, half: 2, float: 4 };
const BREATH_MS = 12; // of work, before the page gets to do anything else

// Returns the distance in rows and columns between two pixels that are read.
export const stepOf = ({ width, height }) => Math.ceil(Math.sqrt((width * height) / MOST_KEPT));

// Returns {step, width, height, planes}; `chunkOf(n)` returns the bytes of chunk n, or null if they are not in the file.
export async function planesOf(part, chunkOf) {
  const step = stepOf(part);
  const [width, height] = [Math.ceil(part.width / step), Math.ceil(part.height / step)];
  const planes = part.channels.map(({ type }) => new (type === "uint" ? Uint32Array : Float32Array)(width * height));
  let since = performance.now();
  for (let chunk = 0; chunk < part.chunks; chunk += 1) {
    const first = chunk * part.rows;
    const rows = Math.min(part.rows, part.height - first);
    if (Math.ceil(first / step) * step >= first + rows) continue;
    const bytes = chunkOf(chunk);
    if (bytes) keep(part, await unpacked(part, bytes, rows), first, rows, step, width, planes);
    if (performance.now() - since > BREATH_MS) {
      await new Promise((resolve) => setTimeout(resolve));
      since = performance.now();
    }
  }
  return { step, width, height, planes };
}

async function unpacked(part, bytes, rows) {
  const size = rows * part.width * part.channels.reduce((sum, { type }) => sum + BYTES[type], 0);
  if (!part.isPacked || bytes.length === size) {
    if (bytes.length !== size) throw new BadExr("A chunk does not have the size of its rows.");
    return bytes.slice();
  }
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const found = new Uint8Array(await new Response(stream).arrayBuffer());
  if (found.length !== size) throw new BadExr("A chunk does not have the size of its rows.");
  return joined(found);
}

// Packed bytes are differences; those at even places come before those at odd ones (OpenEXR, ImfZip.cpp).
function joined(found) {
  const made = new Uint8Array(found.length);
  const half = (found.length + 1) >> 1;
  let value = found[0];
  made[0] = value;
  for (let at = 1; at < found.length; at += 1) {
    value = (value + found[at] - 128) & 255;
    made[at < half ? 2 * at : 2 * (at - half) + 1] = value;
  }
  return made;
}

function keep(part, bytes, first, rows, step, width, planes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  let at = 0;
  for (let row = first; row < first + rows; row += 1) {
    part.channels.forEach(({ type }, number) => {
      if (row % step === 0) {
        const [plane, to] = [planes[number], (row / step) * width];
        for (let column = 0; column < width; column += 1) plane[to + column] = READ[type](view, at + column * step * BYTES[type]);
      }
      at += part.width * BYTES[type];
    });
  }
}

const READ = {
  uint: (view, at) => view.getUint32(at, true),
  float: (view, at) => view.getFloat32(at, true),
  half: (view, at) => HALF[view.getUint16(at, true)],
};
