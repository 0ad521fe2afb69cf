// Fetches a preview as a decoded <img>, so that an answer that is no picture becomes a Failure that can be shown.

import { call, jobPath } from "../base/api.js";

// Resolves to {tag, scale, seen, image, size}. `seen` names the display view of the picture. `image` is null if the server's
// picture is still that of the tag `before`. `size` is that of the whole picture; the image of a large one has fewer pixels.
export async function fetchPicture(job, query, before) {
  const source = new URLSearchParams(Object.entries(query).filter(([, value]) => value !== null)).toString();
  const response = await call("GET", jobPath(job, `/preview?${source}`), { accept: "image/png,image/jpeg,*/*" });
  const tag = `${source} ${response.headers.get("etag")}`;
  const scale = response.headers.get("preview-scale");
  const seen = decodeURIComponent(response.headers.get("preview-view") ?? "");
  const size = response.headers.get("preview-resolution")?.split("x").map(Number);
  if (tag === before) return { tag, scale, seen, image: null };
  const image = new Image();
  image.alt = "";
  image.draggable = false;
  image.src = URL.createObjectURL(await response.blob());
  try {
    await image.decode();
  } catch {
    drop(image);
    return { tag: "", scale, seen, image: null };
  }
  return { tag, scale, seen, image, size: size ?? [image.naturalWidth, image.naturalHeight] };
}

export function drop(image) {
  if (!image) return;
  image.remove();
  URL.revokeObjectURL(image.src);
}
