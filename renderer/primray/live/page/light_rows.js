// Sliders of lights, each with how bright it is, in stops, and of which colour: together its weight of R, G and B in a mix.

const MOST_STOPS = 6; // each way; the lowest turns a light off
const STEP = 0.25;

// Returns a row for each name. `weights` is a Map of [r, g, b] by name; `changed` is called when one of them is another.
export function lightRows(names, weights, changed) {
  return names.map((name) =>
    lightRow(name, (weight) => {
      weights.set(name, weight);
      changed();
    }),
  );
}

// Weights in words of four digits, as commands take them.
export const weightWords = (weight) => weight.map((part) => Number(part.toPrecision(4)));

function lightRow(name, onWeight) {
  const intensity = input("range", `Intensity of ${name}, stops`, { min: -MOST_STOPS, max: MOST_STOPS, step: STEP, value: 0 });
  const color = input("color", `Colour of ${name}`, { value: "#ffffff" });
  const stops = withText("output", "0");

  function weigh() {
    const value = Number(intensity.value);
    const factor = value > -MOST_STOPS ? 2 ** value : 0;
    const tint = [1, 3, 5].map((at) => linear(Number.parseInt(color.value.slice(at, at + 2), 16) / 255));
    stops.textContent = factor === 0 ? "off" : `${value > 0 ? "+" : ""}${value}`;
    intensity.setAttribute("aria-valuetext", factor === 0 ? "off" : `${value} stops`);
    onWeight(tint.map((channel) => channel * factor));
  }

  for (const control of [intensity, color]) control.addEventListener("input", weigh);
  const found = document.createElement("div");
  found.className = "light";
  found.append(withText("span", name), intensity, stops, color);
  return found;
}

function input(type, label, values) {
  const found = Object.assign(document.createElement("input"), { type, ...values });
  found.setAttribute("aria-label", label);
  return found;
}

const withText = (tag, text) => Object.assign(document.createElement(tag), { textContent: text });

// IEC 61966-2-1, from the encoding of sRGB.
const linear = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
