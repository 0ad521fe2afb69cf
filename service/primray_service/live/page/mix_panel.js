// Lights weighed after the render: pictures hold the light of each of them once that is asked for.

import { element, ticked } from "../page/base/dom.js";
import { lightSliders } from "../page/picture/light_sliders.js";
import { send } from "./server.js";

export function mixPanel() {
  const weights = new Map();
  const sliders = lightSliders(weights, () => send({ do: "mix", weights: Object.fromEntries(weights) }));
  const asked = element("input", { type: "checkbox" });
  asked.addEventListener("change", () => send({ do: "lights", on: asked.checked }));
  const root = element(
    "section",
    { class: "card controls", "aria-label": "Mixed lights" },
    ticked("Mix of lights", asked, "rendered again with the light of each apart; the saved EXR has them for the command below"),
    sliders.root,
  );

  let isFirst = true;

  function show({ lights }) {
    if (isFirst && Object.keys(lights?.weights ?? {}).length > 0) send({ do: "mix", weights: {} }); // of the page before
    isFirst = false;
    asked.checked = Boolean(lights);
    sliders.show(lights?.names.length > 0 ? { lights: lights.names } : null);
    const [value, low, high] = lights?.relmse ?? [];
    sliders.tell(lights?.relmse ? { value, low, high } : null);
  }

  return { root, show };
}
