// A mix of a picture's lights: the light of each (part lights.NAME) times its weight, added, with the error of that sum. It is
// what `primray relight` computes (light_mix/mix.py).

const PREFIX = "lights.";
const STORED_APART = 2 ** -9; // parts and picture may be stored with other precisions: halves have 11 bits
const Z95 = 1.959964;

export const isOfLight = ({ kind, part, differences }) => kind === "color" && part.name.startsWith(PREFIX) && differences.length === 3;
export const nameOf = ({ part }) => part.name.slice(PREFIX.length);

// Returns a layer for the viewer that is the mix of these layers, or null if there are no lights among them. `weights` is a Map
// of [r, g, b] by name, read whenever the layer is; lights that it lacks weigh 1.
export function mixOf(layers, weights) {
  const lights = layers.filter(isOfLight);
  const picture = layers.find(({ kind, part }) => kind === "color" && (part.name === "rgba" || part.name === ""));
  if (lights.length === 0 || !picture) return null;
  return {
    ...picture, key: "mix", label: "Mix of lights", meaning: "", lights: lights.map(nameOf),
    read: async () => {
      const read = await Promise.all([picture, ...lights].map((layer) => layer.read()));
      return mixed(read[0], read.slice(1), lights.map((layer) => weights.get(nameOf(layer)) ?? [1, 1, 1]));
    },
  };
}

// Returns the picture with these lights weighed, and `relmse`, its error with a 95 % interval, or null. What no light holds, such
// as a background, stays as it is; where the picture has less light than its lights, as in a ground's shadow, so has the mix.
export function mixed(picture, lights, weights) {
  const count = picture.planes[0].length;
  const planes = [0, 1, 2].map(() => new Float32Array(count));
  const errors = [0, 1, 2].map(() => new Float32Array(count));
  const terms = new Float64Array(count);
  for (let c = 0; c < 3; c += 1) {
    for (let at = 0; at < count; at += 1) {
      let [sum, total, difference] = [0, 0, 0];
      for (let k = 0; k < lights.length; k += 1) {
        const weight = weights[k][c];
        total += lights[k].planes[c][at];
        sum += weight * lights[k].planes[c][at];
        difference += weight * lights[k].differences[c][at];
      }
      const rest = picture.planes[c][at] - total;
      if (Math.abs(rest) > STORED_APART * Math.abs(total)) {
        const left = rest < 0 && total > 0 ? Math.max((total + rest) / total, 0) : 1;
        [sum, difference] = [left * sum + (left === 1 ? rest : 0), left * difference];
      }
      planes[c][at] = sum;
      errors[c][at] = Number.isNaN(difference) ? Infinity : Math.abs(difference);
      terms[at] += difference ** 2 / (sum ** 2 + 0.01);
    }
  }
  return { ...picture, key: "mix", planes: [...planes, ...picture.planes.slice(3)], errors, relmse: errorOf(terms) };
}

// Each squared difference has one degree of freedom, so the variance of a sum of them is 2/3 of the sum of their squares.
function errorOf(terms) {
  let [total, squares] = [0, 0];
  for (const term of terms) [total, squares] = [total + term, squares + term ** 2];
  if (!Number.isFinite(total)) return null;
  const factor = total > 0 ? Math.exp(Math.min((Z95 * Math.sqrt((2 / 3) * squares)) / total, 50)) : 1;
  const value = total / (3 * terms.length);
  return { value, low: value / factor, high: value * factor };
}
