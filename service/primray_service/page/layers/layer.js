// Layers of a picture's file: a layer is some channels of a part, with their meaning.
//
// A kind says how numbers are shown: color (scene-linear), error (of such), direction (unit vectors), vector, scalar, ids
// (whole numbers that stand for names), mattes (Cryptomatte: pairs of an id and its coverage). Colours that are light are seen
// through a view, as the picture is; reflectances and primvars are data, and are not.

const PICTURE = "rgba"; // the part of the picture itself
const LABELS = { denoised: "Denoised picture", samples: "Samples of a pixel" };

// Returns [{key, label, kind, part, channels, errors, differences, names, meaning, ids, space, isLight}] for the parts of
// openExr(), in their order. `channels` and `errors` are the part's channels of its values and of their standard errors,
// `differences` those of signed differences of both halves of its samples, which the light of a light has.
export function layersOf(parts) {
  return parts.flatMap((part, number) => {
    const label = part.name === PICTURE || part.name === "" ? "Picture" : (LABELS[part.name] ?? wordsOf(part.name));
    const meaning = part.strings.get("primray:meaning") ?? "";
    const space = part.strings.get("colorInteropID") ?? "";
    const isLight = space !== "data" && !part.strings.get("primray:source")?.endsWith("albedo");
    const make = (kind, channels, suffix, extra = {}) => ({
      key: `${number}${suffix}`, number, part, kind, channels, meaning, space, isLight,
      label: suffix ? `${label}: ${suffix}` : label,
      names: channels.map((at) => lastWord(part.channels[at].name)),
      errors: [],
      differences: [],
      ids: null,
      ...extra,
    });
    const manifest = manifestOf(part.strings);
    if (manifest) return [make("mattes", pairsOf(part.channels), "", { ids: manifest })];
    const all = part.channels.map((_, at) => at);
    const isError = (at) => part.channels[at].name.split(".").includes("stderr");
    const isDifference = (at) => part.channels[at].name.split(".").at(-2) === "difference"; // of a light's two halves, signed
    const errors = ordered(part, all.filter(isError));
    const differences = ordered(part, all.filter(isDifference));
    const values = ordered(part, all.filter((at) => !isError(at) && !isDifference(at)));
    return [values.length > 0 && { ...plain(part, values, errors, make), differences }, errors.length > 0 && make("error", errors, "standard error")].filter(Boolean);
  });
}

function plain(part, values, errors, make) {
  const names = values.map((at) => lastWord(part.channels[at].name)).join("");
  const text = part.strings.get("primray:ids");
  if (part.channels[values[0]].type === "uint") {
    return text || part.name !== "samples" ? make("ids", values, "", { ids: idsOf(text) }) : make("scalar", values, "");
  }
  if (names.startsWith("RGB")) return make("color", values, "", { errors });
  if (names === "XYZ" && part.name.includes("normal")) return make("direction", values, "", { errors });
  return make(values.length === 1 ? "scalar" : "vector", values, "", { errors });
}

const ORDER = "RGBAXYZUVW";
const lastWord = (name) => name.split(".").at(-1);
const wordsOf = (name) => name.charAt(0).toUpperCase() + name.slice(1).replaceAll("_", " ");

// Files have channels in the order of their names: A B G R.
function ordered(part, channels) {
  const place = (at) => ORDER.indexOf(lastWord(part.channels[at].name));
  return [...channels].sort((a, b) => place(a) - place(b));
}

function idsOf(text) {
  try {
    return new Map(Object.entries(JSON.parse(text ?? "{}")).map(([id, name]) => [Number(id), String(name)]));
  } catch {
    return new Map();
  }
}

// Returns names by the bits of their ids, if the part is a Cryptomatte.
function manifestOf(strings) {
  const text = [...strings].find(([name]) => /^cryptomatte\/.*\/manifest$/.test(name))?.[1];
  if (text === undefined) return null;
  try {
    return new Map(Object.entries(JSON.parse(text)).map(([name, hash]) => [Number.parseInt(hash, 16), name]));
  } catch {
    return new Map();
  }
}

// Returns [id, coverage, id, coverage, ...]: R and G, then B and A of each of its layers.
function pairsOf(channels) {
  const found = channels.map(({ name }, at) => ({ name, at })).filter(({ name }) => /\d\d\.[RGBA]$/i.test(name));
  const place = ({ name }) => name.slice(0, -1) + "RGBA".indexOf(name.at(-1).toUpperCase());
  return found.sort((a, b) => (place(a) < place(b) ? -1 : 1)).map(({ at }) => at);
}

// Returns a layer with its planes, chosen from those of `read`. Each of their pixels covers `step` pixels of the part along
// each side.
export function filled(layer, read) {
  const { width, height, step } = read;
  const of = (channels) => channels.map((at) => read.planes[at]);
  return { ...layer, width, height, step, fullWidth: layer.part.width, fullHeight: layer.part.height, planes: of(layer.channels), errors: of(layer.errors), differences: of(layer.differences) };
}
