// A picture as the renderer has it, scene-linear halfs, and how it gets on the screen: exposure, clipping, sRGB. A half has
// 65,536 values, so both its number and its place on the screen are tables.

import * as format from "../base/format.js";
import { HALF } from "../base/half.js";
import { encoded } from "../base/srgb.js";

const MAGIC = "primrayP";
const HEADER_BYTES = 40;

export class BadPreview extends Error {}

// The file of worker/preview.py: magic, version, size, size of the picture, passes, samples; names; planes of halfs.
export function decodeRaw(buffer) {
  const bytes = new Uint8Array(buffer);
  const view = new DataView(buffer);
  if (bytes.length < HEADER_BYTES + 1 || String.fromCharCode(...bytes.subarray(0, 8)) !== MAGIC || view.getUint32(8, true) !== 1) {
    throw new BadPreview("The raw preview is not of the version that this page reads; reload the page.");
  }
  const [width, height, fullWidth, fullHeight, passes] = [12, 16, 20, 24, 28].map((at) => view.getUint32(at, true));
  let at = HEADER_BYTES;
  const names = Array.from({ length: bytes[at++] }, () => {
    const length = bytes[at++];
    at += length;
    return String.fromCharCode(...bytes.subarray(at - length, at));
  });
  const plane = width * height;
  if (bytes.length !== at + 2 * plane * names.length) throw new BadPreview("The raw preview ended early.");
  const halfs = new Uint16Array(buffer.slice(at)); // where the names end may be odd; every platform of browsers is little-endian
  const channel = (name) => halfs.subarray(names.indexOf(name) * plane, (names.indexOf(name) + 1) * plane);
  const color = ["R", "G", "B"].map(channel);
  const stderr = ["stderr.R", "stderr.G", "stderr.B"].map(channel);
  return { width, height, fullWidth, fullHeight, passes, color, stderr, words: (x, y) => words(color, stderr, y * width + x) };
}

// The values of a pixel with their standard error.
function words(color, stderr, at) {
  const values = color.map((plane) => HALF[plane[at]]);
  const errors = stderr.map((plane) => HALF[plane[at]]);
  const mean = Math.sqrt(errors.reduce((sum, value) => sum + value * value, 0) / 3);
  return `${values.map(format.fixed).join("  ")}  ± ${Number.isFinite(mean) ? format.error(mean) : "?"}`;
}

export function drawPicture(canvas, raw, stops) {
  const scale = 2 ** stops;
  const table = Uint8ClampedArray.from(HALF, (value) => encoded(value * scale));
  const [red, green, blue] = raw.color;
  draw(canvas, raw, (data) => {
    for (let at = 0, to = 0; at < red.length; at += 1, to += 4) {
      data[to] = table[red[at]];
      data[to + 1] = table[green[at]];
      data[to + 2] = table[blue[at]];
      data[to + 3] = 255;
    }
  });
}

// |A - B|, by channel: black where they agree.
export function drawDifference(canvas, a, b, stops, factor) {
  const scale = factor * 2 ** stops;
  const shades = Uint8ClampedArray.from({ length: 4097 }, (_, step) => encoded(step / 4096));
  draw(canvas, a, (data) => {
    for (let channel = 0; channel < 3; channel += 1) {
      const [one, two] = [a.color[channel], b.color[channel]];
      for (let at = 0, to = channel; at < one.length; at += 1, to += 4) {
        data[to] = shades[Math.min(4096, Math.round(4096 * scale * Math.abs(HALF[one[at]] - HALF[two[at]])))];
      }
    }
    for (let to = 3; to < data.length; to += 4) data[to] = 255;
  });
}

function draw(canvas, { width, height }, paint) {
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  paint(image.data);
  context.putImageData(image, 0, 0);
}

// How far A is from B, B taken as what is right: the service's measures (relMSE is the mean of (A - B)^2 / (B^2 + 0.01)).
export function compared(a, b) {
  let [squares, relative, largest, where, equal] = [0, 0, -1, 0, true];
  for (let channel = 0; channel < 3; channel += 1) {
    const [one, two] = [a.color[channel], b.color[channel]];
    for (let at = 0; at < one.length; at += 1) {
      if (one[at] === two[at]) continue;
      equal = false;
      const right = HALF[two[at]];
      const square = (HALF[one[at]] - right) ** 2;
      squares += square;
      relative += square / (right * right + 0.01);
      if (square > largest) [largest, where] = [square, at];
    }
  }
  const values = 3 * a.width * a.height;
  const at = [where % a.width, Math.floor(where / a.width)];
  return { rmse: Math.sqrt(squares / values), relmse: relative / values, largest: Math.sqrt(Math.max(0, largest)), at, equal };
}
