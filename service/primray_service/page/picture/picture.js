// A preview as a decoded <img>: fetched, so that an answer that is no picture becomes a Failure that can be told.

import { call, jobPath } from "../base/api.js";

// {tag, scale, image}; `image` is null where the server still has what `before` names.
export async function fetchPicture(job, query, before) {
  const source = new URLSearchParams(Object.entries(query).filter(([, value]) => value !== null)).toString();
  const response = await call("GET", jobPath(job, `/preview?${source}`), { accept: "image/png,image/jpeg,*/*" });
  const tag = `${source} ${response.headers.get("etag")}`;
  const scale = response.headers.get("preview-scale");
  if (tag === before) return { tag, scale, image: null };
  const image = new Image();
  image.alt = "";
  image.draggable = false;
  image.src = URL.createObjectURL(await response.blob());
  try {
    await image.decode();
  } catch {
    drop(image);
    return { tag: "", scale, image: null };
  }
  return { tag, scale, image };
}

export function drop(image) {
  if (!image) return;
  image.remove();
  URL.revokeObjectURL(image.src);
}
