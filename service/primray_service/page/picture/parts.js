// The layers of a job's files, by frame: found when the job has files, read when somebody looks at one.

import { openExr, rangesOf } from "../exr/file.js";
import { filled, layersOf } from "../layers/layer.js";

export function partsOf() {
  const files = new Map(); // by frame: {row, opened}
  const leaving = new AbortController();
  let rows = [];

  // The job's outputs, as listed.
  function know(outputs) {
    rows = outputs.filter(({ name }) => name.endsWith(".exr"));
  }

  // {name, digest, layers} of each of a frame's EXRs: one, or one for each product that has a file of its own. Layers have `read()`.
  async function of(frame) {
    const its = (number) => rows.filter((each) => each.frame === number);
    const here = its(frame).length > 0 ? its(frame) : its(null);
    const digests = here.map(({ sha256 }) => sha256).join(" ");
    const before = files.get(frame);
    if (before?.digests === digests) return before.opened;
    const opened = Promise.all(here.map((row, index) => open(row, index, leaving.signal)));
    files.clear(); // the planes of one frame are as much as a page should keep
    files.set(frame, { digests, opened });
    opened.catch(() => files.delete(frame));
    return opened;
  }

  return { know, of, close: () => leaving.abort() };
}

async function open(row, index, signal) {
  const file = await openExr(rangesOf(row.urls.immutable, signal), row.bytes);
  // Keys are the same for all frames of a sequence, so that a choice stays from frame to frame.
  const layers = layersOf(file.parts).map((layer) => ({
    ...layer,
    key: index > 0 ? `${index}/${layer.key}` : layer.key,
    read: async () => filled(layer, await file.planes(layer.number)),
  }));
  return { name: row.name, digest: row.sha256, layers };
}
