// What the check of a scene found, in the form that the settings are offered in.

export function factsOf(scene) {
  const facts = scene.facts ?? scene;
  const entries = (facts.entries ?? []).map((entry) => (typeof entry === "string" ? entry : entry.path));
  const cameras = (facts.cameras ?? []).map(camera);
  const settings = facts.render_settings?.[0];
  const chosen = settings?.camera ?? facts.camera?.path ?? facts.camera ?? cameras[0]?.path ?? "";
  return {
    entries,
    entry: facts.entry ?? entries[0] ?? "",
    cameras,
    camera: cameras.some(({ path }) => path === chosen) ? chosen : (cameras[0]?.path ?? ""),
    resolution: settings?.resolution ?? facts.resolution ?? null,
    frames: rangeOf(facts),
  };
}

// A prim path and, if it has it, the shape of the camera's window.
function camera(found) {
  const path = typeof found === "string" ? found : found.path;
  const aspect = typeof found === "string" ? null : (found.aspect ?? null);
  return { path, aspect, name: path };
}

function rangeOf(facts) {
  const range = facts.frame_range ?? facts.frames ?? facts.time ?? null;
  const [start, end] = Array.isArray(range) ? range : [range?.start, range?.end];
  return Number.isFinite(start) && Number.isFinite(end) && end > start ? `${start}:${end}` : "";
}
