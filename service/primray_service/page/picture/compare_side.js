// One of the two pictures of a comparison: its job, and the picture or the part of its file that is shown. The picture is
// shown as the server's own PNG, everything else is drawn here from its numbers.

import { get, jobPath } from "../base/api.js";
import { element, fill } from "../base/dom.js";
import { paint } from "../layers/paint.js";
import { wordsAt } from "../layers/values.js";
import { lookOf } from "./looks.js";
import { partsOf } from "./parts.js";
import { drop, fetchPicture } from "./picture.js";
import { rawOf } from "./raw_image.js";

export const PICTURE = "Picture";

export function compareSide(id) {
  const canvas = element("canvas", {});
  const root = element("div", { class: "layer" });
  const parts = partsOf();
  // `names` lists what can be shown; `layer` is what is shown, null if this job does not have it.
  const self = { id, job: null, layer: null, names: [PICTURE], root, load, show, wordsOf, close };
  let [number, seen] = [0, ""];
  let [tag, image] = ["", null];
  let [loads, showing] = [0, 0]; // counters of requests: only the newest counts

  // Resolves to whether the content has changed. `frame` counts from 1.
  async function load(frame, name) {
    const mine = ++loads;
    self.job = await get(jobPath(id));
    const frames = self.job.progress?.frames;
    number = Math.min(frames?.total ?? 1, Math.max(1, frame)) - 1;
    if ((frames?.succeeded ?? 0) > 0) parts.know((await get(jobPath(id, "/outputs"))).items);
    const files = await parts.of(number);
    // The first file's picture is the preview, which is visible while it refines.
    const layers = files.flatMap((file, index) => file.layers.map((layer) => ({ ...layer, label: index > 0 ? `${file.name}: ${layer.label}` : layer.label })))
      .filter(({ label }) => label !== PICTURE);
    self.names = [PICTURE, ...layers.map(({ label }) => label)];
    const wanted = layers.find(({ label }) => label === name);
    const found = name === PICTURE ? await rawOf(id, number) : wanted ? await wanted.read() : null;
    if (mine !== loads) return false;
    self.layer = found;
    const before = seen;
    seen = `${number} ${name} ${found?.tag ?? files.map(({ digest }) => digest)} ${found === null}`;
    return seen !== before;
  }

  // Resolves to the meaning of its colours for a legend, or null if they represent light. Amounts have the same colours as
  // those of `beside`.
  async function show(look, stops, beside) {
    const mine = ++showing;
    if (!self.layer) {
      fill(root);
      return null;
    }
    if (self.layer.key !== "raw" || look !== "display") {
      const layer = self.layer;
      const wanted = await lookOf(look, layer, stops);
      if (mine !== showing) return null;
      const scale = paint(canvas, layer, { ...wanted, beside });
      fill(root, canvas);
      return scale;
    }
    const found = await fetchPicture(id, { frame: number, exposure: stops }, tag);
    if (mine !== showing) {
      drop(found.image);
    } else if (found.image) {
      const before = image;
      [tag, image] = [found.tag, found.image];
      fill(root, image);
      drop(before);
    } else if (image) fill(root, image);
    return null;
  }

  // Returns its own pixel at a point of a sheet of this size, in whose middle it is shown in its own aspect ratio; null
  // outside of it.
  function pixelOf([x, y], [width, height]) {
    const { fullWidth, fullHeight } = self.layer;
    const scale = Math.min(width / fullWidth, height / fullHeight);
    const own = [(x + 0.5 - width / 2) / scale + fullWidth / 2, (y + 0.5 - height / 2) / scale + fullHeight / 2].map(Math.floor);
    return own[0] >= 0 && own[1] >= 0 && own[0] < fullWidth && own[1] < fullHeight ? own : null;
  }

  function wordsOf(at, size) {
    const pixel = self.layer && pixelOf(at, size);
    if (!pixel) return "";
    const { numbers, names } = wordsAt(self.layer, ...pixel);
    return [numbers, ...names].filter(Boolean).join("  ");
  }

  function close() {
    showing += 1;
    parts.close();
    drop(image);
  }

  return self;
}
