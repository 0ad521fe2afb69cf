// The view of the server's pictures, as a table (pictures/process.py): what is drawn here looks like its PNG.

import { call } from "../base/api.js";

// The server has tables for these linear spaces (pictures/request.py), by the ids that files name.
export const SPACES = ["lin_rec709_scene", "lin_ap1_scene", "lin_ap0_scene", "lin_p3d65_scene", "lin_rec2020_scene", "lin_adobergb_scene"];
const tables = new Map();

// Resolves to {display, view, shade} of light in a space, or null if there is no table for it; fetched once. `through` names a
// job's view, display and look, if they are not the default.
export function serversView(space, through = {}) {
  if (!SPACES.includes(space)) return null;
  const named = ["view", "display", "look"].filter((name) => through[name]).map((name) => [name, through[name]]);
  const query = new URLSearchParams([["space", space], ...named]).toString();
  if (!tables.has(query)) {
    const fetching = fetchTable(query);
    tables.set(query, fetching);
    fetching.catch(() => tables.delete(query));
  }
  return tables.get(query);
}

async function fetchTable(query) {
  const response = await call("GET", `/page/view-table?${query}`, { accept: "*/*" });
  return viewOf(await response.arrayBuffer());
}

export function viewOf(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const { side, least, most, display, view } = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const table = new Uint8Array(buffer, 4 + length);
  const bottom = Math.log2(least);
  const steps = (side - 1) / (Math.log2(most + least) - bottom);
  const [overRed, overGreen, overBlue] = [3 * side * side, 3 * side, 3];

  // Returns a value's position on a side of the cube, from 0 to side - 1; a value that is not finite is black, as in the PNG.
  const place = (value) => (value > 0 && value < Infinity ? Math.min(side - 1, steps * (Math.log2(value + least) - bottom)) : 0);

  // Writes the 8-bit values of a colour to data[to...], interpolated in the tetrahedron that contains it.
  function shade(data, to, red, green, blue) {
    const [x, y, z] = [place(red), place(green), place(blue)];
    const [i, j, k] = [Math.min(side - 2, x | 0), Math.min(side - 2, y | 0), Math.min(side - 2, z | 0)];
    let [a, b, c] = [x - i, y - j, z - k]; // sorted in descending order, with their steps
    let [one, two, three] = [overRed, overGreen, overBlue];
    if (a < b) [a, b, one, two] = [b, a, two, one];
    if (b < c) [b, c, two, three] = [c, b, three, two];
    if (a < b) [a, b, one, two] = [b, a, two, one];
    const first = overRed * i + overGreen * j + overBlue * k;
    const [second, third, last] = [first + one, first + one + two, first + one + two + three];
    for (let n = 0; n < 3; n += 1) {
      data[to + n] = (1 - a) * table[first + n] + (a - b) * table[second + n] + (b - c) * table[third + n] + c * table[last + n];
    }
  }

  return { display, view, shade };
}
