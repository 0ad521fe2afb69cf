// Draws a layer on a canvas by its kind, and returns the meaning of its colours: {low, high, unit, map} for a legend, or null.

import * as format from "../base/format.js";
import { encoded } from "../base/srgb.js";
import { colorOfId, paintAmount } from "./colors.js";

export const FALSE_STOPS = 6; // around mid-grey, each way
const MID_GREY = 0.18;
export const WEIGHTS = [0.2126, 0.7152, 0.0722]; // of luminance, Rec.709
const MOST_DECADES = 4;
const SHADES = Uint8ClampedArray.from({ length: 4097 }, (_, step) => encoded(step / 4096));
const PICKED = 20000; // values that a range is estimated from

// `look` is {stops, channel, isFalse, view, beside}: `view` is serversView(), null for plain sRGB; ranges of amounts include
// those of `beside`, another layer of the same kind.
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

function color(data, layer, { stops, channel, isFalse, view }) {
  const factor = 2 ** stops;
  if (isFalse) {
    const one = single(layer.planes, channel);
    each(data, (to, at) => paintAmount(data, to, (Math.log2(Math.max(factor * one(at), 1e-30) / MID_GREY) / FALSE_STOPS + 1) / 2));
    const end = (sign) => (MID_GREY * 2 ** (sign * FALSE_STOPS)) / factor;
    return { low: format.error(end(-1)), high: format.error(end(1)), unit: `${channel === "rgb" ? "luminance" : channel}, scene-linear, by stops` };
  }
  if (channel === "a") {
    const one = single(layer.planes, channel);
    each(data, (to, at) => gray(data, to, Math.round(255 * one(at))));
  } else if (view) throughView(data, layer, factor, channel, view);
  else if (channel === "rgb") {
    for (let number = 0; number < 3; number += 1) {
      const plane = layer.planes[number];
      each(data, (to, at) => (data[to + number] = shade(factor * plane[at])));
    }
  } else {
    const one = single(layer.planes, channel);
    each(data, (to, at) => gray(data, to, shade(factor * one(at))));
  }
  return null;
}

// Draws as the server's PNG does: colours without their coverage if that can be divided out, one channel as grey.
function throughView(data, layer, factor, channel, view) {
  const [r, g, b, a] = layer.planes;
  const one = channel === "rgb" ? null : single(layer.planes, channel);
  const isStraight = !one && a !== undefined && !shinesUncovered(layer.planes);
  each(data, (to, at) => {
    const alpha = isStraight ? Math.min(1, Math.max(0, a[at])) : 1;
    const scale = alpha > 0 ? factor / alpha : 0;
    if (one) view.shade(data, to, scale * one(at), scale * one(at), scale * one(at));
    else view.shade(data, to, scale * r[at], scale * g[at], scale * b[at]);
    data[to + 3] = Math.round(255 * alpha);
  });
}

// Light where the coverage is zero has no colour without it: such a picture is shown over black.
const shinesUncovered = ([r, g, b, a]) => a.some((share, at) => !(share > 0) && (r[at] > 0 || g[at] > 0 || b[at] > 0));

export const shade = (value) => (value >= 1 ? 255 : value > 0 ? SHADES[Math.round(4096 * value)] : 0);

function gray(data, to, value) {
  data[to] = data[to + 1] = data[to + 2] = value;
}

function each(data, run) {
  for (let to = 0, at = 0; to < data.length; to += 4, at += 1) run(to, at);
}

// Returns one number of a pixel: a channel, or the luminance.
export function single(planes, channel) {
  const number = ["r", "g", "b", "a"].indexOf(channel);
  if (number >= 0) return planes[number] ? (at) => planes[number][at] : () => 1; // a picture without coverage is opaque
  const [r, g, b] = planes;
  return (at) => WEIGHTS[0] * r[at] + WEIGHTS[1] * g[at] + WEIGHTS[2] * b[at];
}

// Spans whole decades around all but the most extreme values, so that the scale is stable, as in the server's error views.
function error(data, layer, { channel, beside }) {
  const by = channel === "a" ? "luminance" : channel;
  const one = single(layer.planes, by);
  const [low, high] = range(layer, beside, (planes) => single(planes, by), (value) => value > 0);
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

function vector(data, layer, { beside }) {
  const ranges = layer.planes.slice(0, 3).map((_, number) => range(layer, beside, (planes) => (at) => planes[number][at]));
  ranges.forEach(([low, high], number) => {
    const plane = layer.planes[number];
    each(data, (to, at) => (data[to + number] = (255 * (plane[at] - low)) / (high - low || 1)));
  });
  const said = ranges.map(([low, high], number) => `${layer.names[number]} ${format.error(low)} to ${format.error(high)}`);
  return { low: "", high: "", unit: `${said.join(", ")}, as ${["red", "green", "blue"].slice(0, ranges.length).join(", ")}`, map: "" };
}

function scalar(data, layer, { beside }) {
  const [plane] = layer.planes;
  const [low, high] = range(layer, beside, ([plane]) => (at) => plane[at]);
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

// Returns finite values of at most PICKED pixels of the picture, and of `beside`, without the most extreme 1/500 at each end.
function range(layer, beside, oneOf, isMeant = () => true) {
  const found = [];
  for (const { width, height, planes } of beside ? [layer, beside] : [layer]) {
    const [count, one] = [width * height, oneOf(planes)];
    const stride = Math.max(1, Math.floor(count / PICKED)) | 1;
    for (let at = 0; at < count; at += stride) {
      const value = one(at);
      if (Number.isFinite(value) && isMeant(value)) found.push(value);
    }
  }
  if (found.length === 0) return [0.1, 1];
  found.sort((a, b) => a - b);
  const cut = Math.floor(found.length / 500);
  return [found[cut], found[found.length - 1 - cut]];
}
