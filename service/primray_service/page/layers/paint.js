// Draws a layer on a canvas by its kind, and says what its colours mean: {low, high, unit, map} for a legend, or null.

import * as format from "../base/format.js";
import { encoded } from "../base/srgb.js";
import { colorOfId, paintAmount } from "./colors.js";

export const FALSE_STOPS = 6; // around mid-grey, each way
const MID_GREY = 0.18;
const WEIGHTS = [0.2126, 0.7152, 0.0722];
const MOST_DECADES = 4;
const SHADES = Uint8ClampedArray.from({ length: 4097 }, (_, step) => encoded(step / 4096));
const PICKED = 20000; // values that a range is judged by

// `look`: {stops, channel, isFalse}.
export function paint(canvas, layer, look) {
  const { width, height } = layer;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const image = context.createImageData(width, height);
  const { data } = image;
  for (let to = 3; to < data.length; to += 4) data[to] = 255;
  const scale = PAINTERS[layer.kind](data, layer, look);
  context.putImageData(image, 0, 0);
  return scale;
}

const PAINTERS = { color, error, direction, vector, scalar, ids, mattes };

function color(data, layer, { stops, channel, isFalse }) {
  const factor = 2 ** stops;
  if (isFalse) {
    const one = single(layer.planes, channel);
    each(data, (to, at) => paintAmount(data, to, (Math.log2(Math.max(factor * one(at), 1e-30) / MID_GREY) / FALSE_STOPS + 1) / 2));
    const end = (sign) => (MID_GREY * 2 ** (sign * FALSE_STOPS)) / factor;
    return { low: format.error(end(-1)), high: format.error(end(1)), unit: `${channel === "rgb" ? "luminance" : channel}, scene-linear, by stops` };
  }
  if (channel === "rgb") {
    for (let number = 0; number < 3; number += 1) {
      const plane = layer.planes[number];
      each(data, (to, at) => (data[to + number] = shade(factor * plane[at])));
    }
    return null;
  }
  const one = single(layer.planes, channel);
  const isCoverage = channel === "a";
  each(data, (to, at) => gray(data, to, isCoverage ? Math.round(255 * one(at)) : shade(factor * one(at))));
  return null;
}

const shade = (value) => (value >= 1 ? 255 : value > 0 ? SHADES[Math.round(4096 * value)] : 0);

function gray(data, to, value) {
  data[to] = data[to + 1] = data[to + 2] = value;
}

function each(data, run) {
  for (let to = 0, at = 0; to < data.length; to += 4, at += 1) run(to, at);
}

// One number of a pixel: a channel, or their luminance.
export function single(planes, channel) {
  const number = ["r", "g", "b", "a"].indexOf(channel);
  if (number >= 0) return planes[number] ? (at) => planes[number][at] : () => 1; // a picture without coverage is opaque
  const [r, g, b] = planes;
  return (at) => WEIGHTS[0] * r[at] + WEIGHTS[1] * g[at] + WEIGHTS[2] * b[at];
}

// Whole decades around all but the most extreme, so that the scale stays put: as the server's error views.
function error(data, layer, { channel }) {
  const one = single(layer.planes, channel === "a" ? "luminance" : channel);
  const [low, high] = range(layer, one, (value) => value > 0);
  const top = Math.ceil(Math.log10(high));
  const bottom = Math.min(Math.max(Math.floor(Math.log10(low)), top - MOST_DECADES), top - 1);
  each(data, (to, at) => {
    const value = one(at);
    if (value === 0) return;
    paintAmount(data, to, Number.isFinite(value) ? (Math.log10(value) - bottom) / (top - bottom) : Number.NaN);
  });
  return { low: format.error(10 ** bottom), high: format.error(10 ** top), unit: "standard error, in the picture’s units; grey: not known" };
}

function direction(data, layer) {
  layer.planes.forEach((plane, number) => each(data, (to, at) => (data[to + number] = 127.5 + 127.5 * plane[at])));
  each(data, (to, at) => layer.planes.every((plane) => plane[at] === 0) && gray(data, to, 0));
  return { low: "−1", high: "1", unit: "X, Y and Z as red, green and blue; black: nothing there", map: "" };
}

function vector(data, layer) {
  const ranges = layer.planes.slice(0, 3).map((plane) => range(layer, (at) => plane[at]));
  ranges.forEach(([low, high], number) => {
    const plane = layer.planes[number];
    each(data, (to, at) => (data[to + number] = (255 * (plane[at] - low)) / (high - low || 1)));
  });
  const said = ranges.map(([low, high], number) => `${layer.names[number]} ${format.error(low)} to ${format.error(high)}`);
  return { low: "", high: "", unit: `${said.join(", ")}, as ${["red", "green", "blue"].slice(0, ranges.length).join(", ")}`, map: "" };
}

function scalar(data, layer) {
  const [plane] = layer.planes;
  const [low, high] = range(layer, (at) => plane[at]);
  each(data, (to, at) => paintAmount(data, to, Number.isFinite(plane[at]) ? (plane[at] - low) / (high - low || 1) : Number.NaN));
  return { low: format.error(low), high: format.error(high), unit: "grey: nothing there" };
}

function ids(data, layer) {
  const [plane] = layer.planes;
  const colors = new Map();
  each(data, (to, at) => {
    const id = plane[at];
    if (!colors.has(id)) colors.set(id, colorOfId(id));
    [data[to], data[to + 1], data[to + 2]] = colors.get(id);
  });
  return { low: "", high: "", unit: `${format.plural(colors.size - (colors.has(0) ? 1 : 0), "id")}, a colour each; black: none`, map: "" };
}

function mattes(data, layer) {
  const colors = new Map();
  for (let pair = 0; pair + 1 < layer.planes.length; pair += 2) {
    const [bits, coverage] = [bitsOf(layer.planes[pair]), layer.planes[pair + 1]];
    each(data, (to, at) => {
      const share = coverage[at];
      if (!(share > 0)) return;
      const id = bits[at];
      if (!colors.has(id)) colors.set(id, colorOfId(id));
      const [r, g, b] = colors.get(id);
      data[to] += share * r;
      data[to + 1] += share * g;
      data[to + 2] += share * b;
    });
  }
  return { low: "", high: "", unit: `${format.plural(colors.size, "matte")}, a colour each, by its coverage`, map: "" };
}

export const bitsOf = (plane) => new Uint32Array(plane.buffer, plane.byteOffset, plane.length);

// The finite values but for the most extreme five hundredth of each end, of so many pixels over the picture.
function range({ width, height }, one, isMeant = () => true) {
  const count = width * height;
  const stride = Math.max(1, Math.floor(count / PICKED)) | 1;
  const found = [];
  for (let at = 0; at < count; at += stride) {
    const value = one(at);
    if (Number.isFinite(value) && isMeant(value)) found.push(value);
  }
  if (found.length === 0) return [0.1, 1];
  found.sort((a, b) => a - b);
  const cut = Math.floor(found.length / 500);
  return [found[cut], found[found.length - 1 - cut]];
}
