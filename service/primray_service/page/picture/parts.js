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

  // {name, digest, layers, read(layer)} of a frame's first EXR, or null where there is none.
  async function of(frame) {
    const row = rows.find((each) => each.frame === frame) ?? rows.find((each) => each.frame === null);
    if (!row) return null;
    const before = files.get(frame);
    if (before?.row.sha256 === row.sha256) return before.opened;
    const opened = open(row, leaving.signal);
    files.clear(); // the planes of one frame are as much as a page should keep
    files.set(frame, { row, opened });
    opened.catch(() => files.delete(frame));
    return opened;
  }

  return { know, of, close: () => leaving.abort() };
}

async function open(row, signal) {
  const file = await openExr(rangesOf(row.urls.immutable, signal), row.bytes);
  const read = async (layer) => filled(layer, await file.planes(layer.number));
  return { name: row.name, digest: row.sha256, layers: layersOf(file.parts), read };
}
