// Difference of two layers of one kind and size: where, how large, and whether larger than their errors explain.

import * as format from "../base/format.js";
import { paintAmount } from "./colors.js";
import { WEIGHTS, bitsOf, shade } from "./paint.js";

const MOST_Z = 6; // standard errors at the end of the scale
const BEYOND = 3; // standard errors that chance alone exceeds in 0.3 % of pixels
const FLOOR = 0.01; // of relMSE: the mean of (A - B)^2 / (B^2 + 0.01)

// Returns why the two have no difference, or "".
export function unlike(a, b) {
  if (a.fullWidth !== b.fullWidth || a.fullHeight !== b.fullHeight) return `The sizes differ (${a.fullWidth} × ${a.fullHeight} and ${b.fullWidth} × ${b.fullHeight})`;
  if (a.width !== b.width || a.height !== b.height) return "One of the two has fewer pixels here than the other";
  const isAlike = a.kind === b.kind && (["color", "mattes"].includes(a.kind) || a.planes.length === b.planes.length);
  return isAlike ? "" : "The two are of different kinds";
}

// Returns {planes, deviations, facts}: `planes` are
//
// A - B
//
//  by channel, infinite where only one has a value; `deviations` are differences divided by their standard errors, or null if
// errors are not known; `facts` is [[name, words]].
export function differenceOf(a, b) {
  if (a.kind === "ids") return named(idsApart(a, b), "Pixels that differ");
  if (a.kind === "mattes") return named(mattesApart(a, b), "Coverage that differs, in the mean");
  const channels = Math.min(a.planes.length, b.planes.length, 3); // not coverage
  let [squares, relative, largest, where, apart, isEqual] = [0, 0, -1, 0, 0, true];
  const planes = a.planes.slice(0, channels).map((one, channel) => {
    const two = b.planes[channel];
    return Float32Array.from(one, (value, at) => {
      const right = two[at];
      if (value === right || (Number.isNaN(value) && Number.isNaN(right))) return 0;
      isEqual = false;
      const size = Math.abs(value - right);
      if (!Number.isFinite(size)) {
        apart += 1;
        return Number.POSITIVE_INFINITY;
      }
      squares += size * size;
      relative += (size * size) / (right * right + FLOOR);
      if (size > largest) [largest, where] = [size, at];
      return size;
    });
  });
  const deviations = deviationsOf(a, b);
  const count = channels * a.width * a.height;
  const facts = isEqual
    ? [["Difference", "none: every value is the same"]]
    : [
        ["Root of the mean square", format.error(Math.sqrt(squares / count))],
        a.kind === "color" && ["relMSE of A against B", format.error(relative / count)],
        ["Largest", `${format.error(Math.max(0, largest))} at ${placeOf(a, where)}`],
        apart > 0 && ["Finite in one alone", format.plural(apart, "value")],
        deviations && [`More than ${BEYOND} standard errors apart`, `${format.percentOf(beyond(deviations))} of the pixels; 0.3 % by chance`],
      ].filter(Boolean);
  return { planes, deviations, facts };
}

const placeOf = ({ width, step }, at) => `${step * (at % width)}, ${step * Math.floor(at / width)}`;

function named(plane, name) {
  const sum = plane.reduce((total, value) => total + value, 0);
  const facts = sum === 0 ? [["Difference", "none: every pixel is the same"]] : [[name, format.percentOf(sum / plane.length)]];
  return { planes: [plane], deviations: null, facts };
}

// Ids are compared by name, since the same prim has another number in another job.
function idsApart(a, b) {
  const [nameInA, nameInB] = [namesOf(a), namesOf(b)];
  return Float32Array.from(a.planes[0], (id, at) => (nameInA(id) === nameInB(b.planes[0][at]) ? 0 : 1));
}

// Returns a function that returns an id's name, or the id if it has none.
const namesOf = ({ ids }) => (id) => (id === 0 ? 0 : (ids.get(id) ?? id));

// Returns half the sum of the differences of each name's coverage, from 0 to 1.
function mattesApart(a, b) {
  const [nameInA, nameInB] = [namesOf(a), namesOf(b)];
  const pairs = (layer) => Array.from({ length: layer.planes.length >> 1 }, (_, pair) => [bitsOf(layer.planes[2 * pair]), layer.planes[2 * pair + 1]]);
  const [ofA, ofB] = [pairs(a), pairs(b)];
  return Float32Array.from({ length: a.width * a.height }, (_, at) => {
    const shares = new Map();
    for (const [bits, coverage] of ofA) if (coverage[at] > 0) add(shares, nameInA(bits[at]), coverage[at]);
    for (const [bits, coverage] of ofB) if (coverage[at] > 0) add(shares, nameInB(bits[at]), -coverage[at]);
    let sum = 0;
    for (const share of shares.values()) sum += Math.abs(share);
    return sum / 2;
  });
}

const add = (shares, name, share) => shares.set(name, (shares.get(name) ?? 0) + share);

// Returns the standard error of luminance for three channels, whose errors add up, since they share the same paths. Errors of
// the two pictures are independent. NaN if an error is not known.
function deviationsOf(a, b) {
  const count = a.errors.length;
  if (count === 0 || count !== b.errors.length || (count !== 3 && count !== 1)) return null;
  const weights = count === 3 ? WEIGHTS : [1];
  return Float32Array.from({ length: a.width * a.height }, (_, at) => {
    let [difference, ofA, ofB] = [0, 0, 0];
    for (let n = 0; n < count; n += 1) {
      difference += weights[n] * (a.planes[n][at] - b.planes[n][at]);
      ofA += weights[n] * a.errors[n][at];
      ofB += weights[n] * b.errors[n][at];
    }
    if (!Number.isFinite(ofA + ofB)) return Number.NaN;
    return difference === 0 ? 0 : Math.abs(difference) / Math.hypot(ofA, ofB);
  });
}

const beyond = (deviations) => deviations.reduce((sum, value) => sum + (value > BEYOND ? 1 : 0), 0) / deviations.length;

// Draws
//
// A - B
//
// : colours times `gain`, black where they agree; amounts over their range. Returns a scale for a legend, or null.
export function paintDifference(canvas, layer, { planes }, gain) {
  return painted(canvas, layer, (data, count) => {
    if (layer.kind === "color") {
      for (let at = 0; at < count; at += 1) planes.forEach((plane, channel) => (data[4 * at + channel] = shade(gain * plane[at])));
      return null;
    }
    const sizes = Float32Array.from({ length: count }, (_, at) => Math.hypot(...planes.map((plane) => plane[at])));
    const top = sizes.reduce((most, size) => (Number.isFinite(size) ? Math.max(most, size) : most), 0);
    for (let at = 0; at < count; at += 1) paintAmount(data, 4 * at, top > 0 ? sizes[at] / top : sizes[at]);
    return { low: "0", high: format.error(top), unit: "how far A and B are apart" };
  });
}

export function paintDeviations(canvas, layer, { deviations }) {
  return painted(canvas, layer, (data, count) => {
    for (let at = 0; at < count; at += 1) paintAmount(data, 4 * at, deviations[at] / MOST_Z);
    return { low: "0", high: String(MOST_Z), unit: `standard errors of A − B; above ${BEYOND} chance seldom goes; grey: not known` };
  });
}

function painted(canvas, { width, height }, draw) {
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const image = context.createImageData(width, height);
  for (let to = 3; to < image.data.length; to += 4) image.data[to] = 255;
  const scale = draw(image.data, width * height);
  context.putImageData(image, 0, 0);
  return scale;
}
