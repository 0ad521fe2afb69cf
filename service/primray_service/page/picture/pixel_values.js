// Shows the values of the pixel under the pointer: the renderer's (from the half-float preview, or the part that is shown),
// those on the screen, and the prim there, if the job's file has ids.

import { element, fill, write } from "../base/dom.js";
import { namesAt, wordsAt } from "../layers/values.js";
import { rawOf } from "./raw_image.js";

const RAW_AGE_S = 2; // of values while the picture refines

// `shown()` returns {frame, layer, image, size, isLive}; `layerOfIds(frame)` resolves to a layer of prims, or null.
export function pixelValues(job, shown, layerOfIds) {
  const root = element("output", { class: "values", "aria-label": "Values of the pixel under the cursor" });
  let raw = null; // {frame, whileLive, at, layer, pending}
  let ids = null; // {frame, layer}
  let pixel = null;
  const reader = element("canvas", { width: 1, height: 1 }).getContext("2d", { willReadFrequently: true });

  function showAt(at) {
    pixel = at;
    const now = shown();
    if (!at || (!now.image && !now.layer)) {
      write(root, "");
      return "";
    }
    const found = now.layer ? wordsAt(now.layer, ...at) : { numbers: rawWords(at, now), names: [] };
    const names = [...found.names, ...(found.names.length ? [] : prims(at, now))];
    const screen = screenAt(at, now);
    const words = [found.numbers, ...names].filter(Boolean).join("  ");
    fill(
      root,
      element("span", {}, `x ${at[0]}, y ${at[1]}`),
      found.numbers && element("span", { class: "numbers" }, found.numbers),
      screen && element("span", { class: "display" }, element("span", { class: "soft" }, "display "), screen),
      names.map((name) => element("span", { class: "prim" }, name)),
      coarse(now.layer ?? raw?.layer),
    );
    return words === "…" ? "" : `Pixel ${at[0]}, ${at[1]}: ${words}`;
  }

  function rawWords(at, { frame, isLive }) {
    if (raw?.frame !== frame) raw = null;
    const isOld = raw?.whileLive && !raw.pending && (!isLive || Date.now() - raw.at > 1000 * RAW_AGE_S);
    if (!raw || isOld) fetchRaw(frame, isLive);
    return raw.layer ? wordsAt(raw.layer, ...at).numbers : "…";
  }

  async function fetchRaw(frame, whileLive) {
    const mine = { frame, whileLive, at: Date.now(), layer: raw?.layer ?? null, pending: true };
    raw = mine;
    try {
      mine.layer = await rawOf(job, frame);
    } catch (failure) {
      if (!failure.problem) write(root, failure.message);
    }
    mine.pending = false;
    if (raw === mine && pixel) showAt(pixel);
  }

  // Returns the paths of the prims at a pixel; the part with their ids is fetched on the first call.
  function prims(at, { frame }) {
    if (ids?.frame !== frame) {
      const mine = { frame, layer: null };
      ids = mine;
      layerOfIds(frame).then((layer) => {
        mine.layer = layer;
        if (layer && ids === mine && pixel) showAt(pixel);
      }, () => {});
    }
    const { layer } = ids;
    return layer ? namesAt(layer, ...at) : [];
  }

  // Returns the 8-bit values on the screen.
  function screenAt(at, { image, size }) {
    if (!image) return "";
    const [width, height] = [image.naturalWidth ?? image.width, image.naturalHeight ?? image.height];
    reader.clearRect(0, 0, 1, 1);
    reader.drawImage(image, Math.floor((at[0] * width) / size[0]), Math.floor((at[1] * height) / size[1]), 1, 1, 0, 0, 1, 1);
    return [...reader.getImageData(0, 0, 1, 1).data.slice(0, 3)].join(" ");
  }

  return {
    root,
    showAt,
    // The frames' files have changed.
    forget: () => (ids = null),
    again: () => pixel && showAt(pixel),
  };
}

// Pixels of a layer that has fewer than the picture.
export function coarse(layer) {
  if (!layer || layer.step === 1) return null;
  return element("span", {}, layer.isMean ? `mean of ${layer.step}² pixels` : `one of ${layer.step}² pixels`);
}
