// One of the two pictures that are compared: its job, its half floats, and how it is shown: as the renderer's own PNG would be
// (the server's work), or plainly encoded as sRGB (computed here).

import { call, get, jobPath } from "../base/api.js";
import { element, fill } from "../base/dom.js";
import { drop, fetchPicture } from "./picture.js";
import { decodeRaw, drawPicture } from "./raw_image.js";

export function compareSide(id) {
  const canvas = element("canvas", {});
  const layer = element("div", { class: "layer" });
  const self = { id, job: null, raw: null, layer, load, show, close };
  let rawTag = "";
  let [tag, image] = ["", null];
  let number = 0;

  // Whether its picture is another than before.
  async function load(frame) {
    self.job = await get(jobPath(id));
    number = Math.min(self.job.progress?.frames?.total ?? 1, Math.max(1, frame)) - 1;
    const response = await call("GET", jobPath(id, `/preview?format=raw&frame=${number}`), { accept: "*/*" });
    const now = `${number} ${response.headers.get("etag")}`;
    if (now === rawTag) return false;
    self.raw = decodeRaw(await response.arrayBuffer());
    rawTag = now;
    return true;
  }

  async function show(look, stops) {
    if (look === "srgb") {
      drawPicture(canvas, self.raw, stops);
      fill(layer, canvas);
      return;
    }
    const found = await fetchPicture(id, { frame: number, exposure: stops }, tag);
    if (found.image) {
      const before = image;
      [tag, image] = [found.tag, found.image];
      fill(layer, image);
      drop(before);
    } else if (image) fill(layer, image);
  }

  function close() {
    drop(image);
  }

  return self;
}
