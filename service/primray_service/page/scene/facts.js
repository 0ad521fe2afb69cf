// What the check of a scene found, in the form that the settings need.

const MOST_VARIANTS = 24; // sets that are offered; a scene may have thousands

export function factsOf(scene) {
  const entries = scene.entries ?? [];
  const cameras = (scene.cameras ?? []).map(({ path, aspect }) => ({ path, aspect: aspect > 0 ? aspect : null }));
  const isKnown = (path) => cameras.some((camera) => camera.path === path);
  return {
    entries,
    entry: entries.includes(scene.entry) ? scene.entry : likeliest(entries, scene.name ?? ""),
    cameras,
    camera: isKnown(scene.camera) ? scene.camera : (cameras[0]?.path ?? ""),
    resolution: scene.resolution ?? scene.render_settings?.find(({ resolution }) => resolution)?.resolution ?? null,
    frames: rangeOf(scene.frame_range),
    products: (scene.render_settings ?? []).flatMap(({ products }) => products ?? []),
    variants: (scene.variants ?? []).slice(0, MOST_VARIANTS),
  };
}

const USUAL = /^(scene|main|root|shot|stage|asset|index)\b/i;

// Chooses a root among several layers: the one named like the package, or a usual name of roots, or the only layer in text.
function likeliest(entries, name) {
  const stem = (path) => path.split("/").at(-1).replace(/\.\w+$/, "").toLowerCase();
  const texts = entries.filter((path) => path.endsWith(".usda"));
  return (
    entries.find((path) => stem(path) === stem(name)) ??
    entries.find((path) => USUAL.test(stem(path))) ??
    (texts.length === 1 ? texts[0] : entries[0]) ??
    ""
  );
}

function rangeOf(range) {
  const { start, end } = range ?? {};
  return Number.isFinite(start) && Number.isFinite(end) && end > start ? `${start}:${end}` : "";
}
