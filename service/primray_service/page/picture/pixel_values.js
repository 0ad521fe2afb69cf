// The values of the pixel under the pointer: as the renderer has them (from the half-float preview, or the part that is shown),
// as they are on the screen, and the prim that is there, where the job's file can tell.

import { call, jobPath } from "../base/api.js";
import { element, fill, write } from "../base/dom.js";
import { namesAt, wordsAt } from "../layers/values.js";
import { decodeRaw } from "./raw_image.js";

const RAW_AGE_S = 2; // of values while the picture refines

// `shown()`: {frame, layer, image, size, isLive}; `layerOfIds(frame)` resolves to a layer of prims, or null.
export function pixelValues(job, shown, layerOfIds) {
  const root = element("output", { class: "values", "aria-label": "Values of the pixel under the cursor" });
  let raw = null; // {frame, at, image, pending}
  let ids = null; // {frame, layer}
  let pixel = null;
  const reader = element("canvas", { width: 1, height: 1 }).getContext("2d", { willReadFrequently: true });

  function tell(at) {
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
      meanOf(now),
    );
    return words === "…" ? "" : `Pixel ${at[0]}, ${at[1]}: ${words}`;
  }

  function meanOf(now) {
    const image = now.layer ? null : raw?.image;
    const box = image && image.fullWidth > image.width ? Math.ceil(image.fullWidth / image.width) : 1;
    return box > 1 && element("span", {}, `mean of ${box}² pixels`);
  }

  function rawWords(at, { frame, isLive }) {
    if (raw?.frame !== frame) raw = null;
    if (!raw || (!raw.pending && isLive && Date.now() - raw.at > 1000 * RAW_AGE_S)) fetchRaw(frame);
    return raw.image ? raw.image.words(...at) : "…";
  }

  async function fetchRaw(frame) {
    const mine = { frame, at: Date.now(), image: raw?.image ?? null, pending: true };
    raw = mine;
    try {
      mine.image = await rawOf(job, frame);
    } catch (failure) {
      if (!failure.problem) write(root, failure.message);
    }
    mine.pending = false;
    if (raw === mine && pixel) tell(pixel);
  }

  // Paths of the prims at a pixel; the part that tells is fetched when it is first asked.
  function prims(at, { frame, size }) {
    if (ids?.frame !== frame) {
      const mine = { frame, layer: null };
      ids = mine;
      layerOfIds(frame).then((layer) => {
        mine.layer = layer;
        if (layer && ids === mine && pixel) tell(pixel);
      }, () => {});
    }
    const { layer } = ids;
    if (!layer) return [];
    return namesAt(layer, Math.floor(((at[0] + 0.5) * layer.fullWidth) / size[0]), Math.floor(((at[1] + 0.5) * layer.fullHeight) / size[1]));
  }

  // The 8-bit values that are seen there.
  function screenAt(at, { image, size }) {
    if (!image) return "";
    const [width, height] = [image.naturalWidth ?? image.width, image.naturalHeight ?? image.height];
    reader.clearRect(0, 0, 1, 1);
    reader.drawImage(image, Math.floor((at[0] * width) / size[0]), Math.floor((at[1] * height) / size[1]), 1, 1, 0, 0, 1, 1);
    return [...reader.getImageData(0, 0, 1, 1).data.slice(0, 3)].join(" ");
  }

  return {
    root,
    tell,
    // Something else is known of the frames' files.
    forget: () => (ids = null),
    again: () => pixel && tell(pixel),
  };
}

export async function rawOf(job, frame) {
  const which = frame === null ? "" : `&frame=${frame}`;
  const response = await call("GET", jobPath(job, `/preview?format=raw${which}`), { accept: "*/*" });
  return decodeRaw(await response.arrayBuffer());
}
