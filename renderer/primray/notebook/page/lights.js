// Sliders of the lights of a view's picture, once the kernel sends their names: intensity in stops and a colour for each.

const MOST_STOPS = 6; // each way; the lowest turns a light off
const STEP = 0.25;

// `part` has the rows, the error and the call of Python that makes the same mix. `send` is a sender's (live/page/sender.js).
export function lightMix({ asked, mix, lights, mixed, call }, send) {
  const weights = new Map();
  let names = [];

  asked.addEventListener("click", () => send({ do: "lights", on: asked.getAttribute("aria-pressed") !== "true" }));

  function row(name) {
    const intensity = input("range", `Intensity of ${name}, stops`, { min: -MOST_STOPS, max: MOST_STOPS, step: STEP, value: 0 });
    const color = input("color", `Colour of ${name}`, { value: "#ffffff" });
    const stops = Object.assign(document.createElement("output"), { textContent: "0" });

    function weigh() {
      const value = Number(intensity.value);
      const factor = value > -MOST_STOPS ? 2 ** value : 0;
      const tint = [1, 3, 5].map((at) => linear(Number.parseInt(color.value.slice(at, at + 2), 16) / 255));
      stops.textContent = factor === 0 ? "off" : `${value > 0 ? "+" : ""}${value}`;
      weights.set(name, tint.map((channel) => channel * factor));
      changed();
    }

    for (const control of [intensity, color]) control.addEventListener("input", weigh);
    const found = document.createElement("div");
    found.className = "light";
    found.append(Object.assign(document.createElement("span"), { textContent: name }), intensity, stops, color);
    return found;
  }

  function changed() {
    const words = [...weights].map(([name, of]) => `${JSON.stringify(name)}: (${of.map((w) => Number(w.toPrecision(4))).join(", ")})`);
    call.textContent = words.length > 0 ? `primray.relight(view.image, {${words.join(", ")}})` : "";
    send({ do: "mix", weights: Object.fromEntries(weights) });
  }

  function show(found) {
    asked.setAttribute("aria-pressed", String(Boolean(found)));
    mix.hidden = !(found?.names.length > 0);
    if (mix.hidden) return;
    if (found.names.join() !== names.join()) {
      const isMixed = Object.keys(found.weights).length > 0; // by a page before
      names = found.names;
      weights.clear();
      lights.replaceChildren(...names.map(row));
      if (isMixed) changed();
    }
    const [value, low, high] = found.relmse ?? [];
    mixed.textContent = found.relmse ? `error (relMSE) of the mix ${brief(value)}, 95 %: ${brief(low)} to ${brief(high)}` : "";
  }

  return { show };
}

function input(type, label, values) {
  const found = Object.assign(document.createElement("input"), { type, ...values });
  found.setAttribute("aria-label", label);
  return found;
}

// IEC 61966-2-1, from the encoding of sRGB.
const linear = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
const brief = (number) => number.toPrecision(2);
