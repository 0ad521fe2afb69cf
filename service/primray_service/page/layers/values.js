// Describes a layer's value at one pixel in words.

import * as format from "../base/format.js";
import { bitsOf } from "./paint.js";

const MOST_MATTES = 4; // of a pixel, the largest ones

// Returns {numbers, names} at x, y in pixels of the whole picture.
export function wordsAt(layer, x, y) {
  const at = indexAt(layer, x, y);
  if (layer.kind === "mattes") return { numbers: "", names: mattesAt(layer, at).map(([name, share]) => `${name} ${format.percentOf(share)}`) };
  if (layer.kind === "ids") {
    const id = layer.planes[0][at];
    return { numbers: String(id), names: id === 0 ? [] : [layer.ids.get(id) ?? "without a name"] };
  }
  const alone = layer.names.length === 1;
  const values = layer.planes.map((plane, number) => `${alone ? "" : `${layer.names[number]} `}${format.fixed(plane[at])}`);
  return { numbers: [...values, errorAt(layer, at)].filter(Boolean).join("  "), names: [] };
}

// Returns the root mean square of the channels' standard errors.
function errorAt(layer, at) {
  if (layer.errors.length === 0) return "";
  const mean = Math.sqrt(layer.errors.reduce((sum, plane) => sum + plane[at] ** 2, 0) / layer.errors.length);
  return `± ${Number.isFinite(mean) ? format.error(mean) : "?"}`;
}

function mattesAt(layer, at) {
  const found = [];
  for (let pair = 0; pair + 1 < layer.planes.length; pair += 2) {
    const share = layer.planes[pair + 1][at];
    if (share > 0) found.push([nameOf(layer.ids, bitsOf(layer.planes[pair])[at]), share]);
  }
  return found.slice(0, MOST_MATTES);
}

// Returns the number that mattes are picked by, for ids that have no room in the manifest.
const nameOf = (ids, bits) => ids.get(bits) ?? `#${bits.toString(16).padStart(8, "0")}`;

export function indexAt(layer, x, y) {
  const column = Math.min(layer.width - 1, Math.floor(x / layer.step));
  const row = Math.min(layer.height - 1, Math.floor(y / layer.step));
  return row * layer.width + column;
}

// Returns the paths of the prims at a pixel, by a layer of ids or mattes.
export const namesAt = (layer, x, y) => wordsAt(layer, x, y).names;
