// Colours that represent numbers: viridis for amounts, hues for ids.

// viridis at even steps, by S. van der Walt and N. Smith, CC0.
const VIRIDIS = [
  [68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142],
  [31, 158, 137], [53, 183, 121], [109, 205, 89], [180, 222, 44], [253, 231, 37],
];
const STEPS = 1024;

// Returns 3 bytes for each of STEPS + 1 values from 0 to 1.
const MAP = Uint8ClampedArray.from({ length: 3 * (STEPS + 1) }, (_, at) => {
  const position = (Math.floor(at / 3) / STEPS) * (VIRIDIS.length - 1);
  const below = Math.min(VIRIDIS.length - 2, Math.floor(position));
  const [a, b] = [VIRIDIS[below][at % 3], VIRIDIS[below + 1][at % 3]];
  return a + (b - a) * (position - below);
});

export const UNKNOWN = 96; // grey, which is not in the map

export function paintAmount(data, to, share) {
  if (Number.isNaN(share)) {
    data[to] = data[to + 1] = data[to + 2] = UNKNOWN;
    return;
  }
  const at = 3 * Math.round(STEPS * Math.min(1, Math.max(0, share)));
  data[to] = MAP[at];
  data[to + 1] = MAP[at + 1];
  data[to + 2] = MAP[at + 2];
}

// Returns a colour [r, g, b] that is the same for equal ids, and seldom close to that of another id, least of all the next:
// hues advance by the golden section of the circle.
export function colorOfId(id) {
  if (id === 0) return [0, 0, 0];
  let mixed = Math.imul(id ^ (id >>> 16), 0x45d9f3b);
  mixed = Math.imul(mixed ^ (mixed >>> 16), 0x45d9f3b);
  mixed = (mixed ^ (mixed >>> 16)) >>> 0;
  const hue = (Math.imul(id, 0x9e3779b1) >>> 0) / 2 ** 32;
  const saturation = 0.45 + 0.4 * (((mixed >>> 16) & 255) / 255);
  const value = 0.65 + 0.35 * ((mixed >>> 24) / 255);
  return [5, 3, 1].map((n) => {
    const k = (n + 6 * hue) % 6;
    return Math.round(255 * value * (1 - saturation * Math.max(0, Math.min(k, 4 - k, 1))));
  });
}
