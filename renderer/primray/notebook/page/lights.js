// Sliders of the lights of a view's picture, once the kernel sends their names, with the call of Python that makes the same mix.

import { lightRows, weightWords } from "../../live/page/light_rows.js";

// `part` has the rows, the error and the call. `send` is a sender's (live/page/sender.js).
export function lightMix({ asked, mix, lights, mixed, call }, send) {
  const weights = new Map();
  let names = [];

  asked.addEventListener("click", () => send({ do: "lights", on: asked.getAttribute("aria-pressed") !== "true" }));

  function changed() {
    const words = [...weights].map(([name, weight]) => `${JSON.stringify(name)}: (${weightWords(weight).join(", ")})`);
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
      lights.replaceChildren(...lightRows(names, weights, changed));
      if (isMixed) changed();
    }
    const [value, low, high] = found.relmse ?? [];
    mixed.textContent = found.relmse ? `error (relMSE) of the mix ${brief(value)}, 95 %: ${brief(low)} to ${brief(high)}` : "";
  }

  return { show };
}

const brief = (number) => number.toPrecision(2);
