// The layers of a job's files, by frame: listed when the job has files, read when one is shown.

import { openExr, rangesOf } from "../exr/file.js";
import { filled, layersOf } from "../layers/layer.js";
import { mixOf } from "../layers/mix.js";

// `weights`: of lights in a mix, a Map of [r, g, b] by name; without it no mix is listed.
export function partsOf(weights = null) {
  const files = new Map(); // by frame: {row, opened}
  const leaving = new AbortController();
  let rows = [];

  // The job's outputs, as listed.
  function know(outputs) {
    rows = outputs.filter(({ name }) => name.endsWith(".exr"));
  }

  // Resolves to {name, digest, layers} for each EXR of a frame: one, or one for each product with a file of its own. Layers
  // have `read()`.
  async function of(frame) {
    const its = (number) => rows.filter((each) => each.frame === number);
    const here = its(frame).length > 0 ? its(frame) : its(null);
    const digests = here.map(({ sha256 }) => sha256).join(" ");
    const before = files.get(frame);
    if (before?.digests === digests) return before.opened;
    const opened = Promise.all(here.map((row, index) => open(row, index, leaving.signal, weights)));
    files.clear(); // a page should hold the planes of one frame at most
    files.set(frame, { digests, opened });
    opened.catch(() => files.delete(frame));
    return opened;
  }

  return { know, of, close: () => leaving.abort() };
}

async function open(row, index, signal, weights) {
  const file = await openExr(rangesOf(row.urls.immutable, signal), row.bytes);
  // Keys are the same for all frames of a sequence, so that a choice applies to the next frame too.
  const layers = layersOf(file.parts).map((layer) => ({
    ...layer,
    key: index > 0 ? `${index}/${layer.key}` : layer.key,
    read: async () => filled(layer, await file.planes(layer.number)),
  }));
  const mix = weights && mixOf(layers, weights);
  return { name: row.name, digest: row.sha256, layers: mix ? [{ ...mix, key: index > 0 ? `${index}/mix` : "mix" }, ...layers] : layers };
}
