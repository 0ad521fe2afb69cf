// What the colours of an error view mean, from the answer's Preview-Scale.

import { element, fill } from "../base/dom.js";
import * as format from "../base/format.js";

export function legend() {
  const root = element("p", { class: "legend", hidden: true });

  // log10;low=1e-3;high=1e0;unit=radiance;map=viridis;...
  function show(scale) {
    const found = Object.fromEntries((scale ?? "").split(";").map((part) => part.split("=")));
    const [low, high] = [Number(found.low), Number(found.high)];
    root.hidden = !(low > 0 && high > low);
    if (root.hidden) return;
    const unit = found.unit === "radiance" ? "standard error, in the picture’s units" : "standard error, relative to the pixel";
    fill(root, element("span", {}, format.error(low)), element("i", { class: "viridis" }), element("span", {}, format.error(high)), element("span", { class: "soft" }, `${unit}; grey: not known yet`));
  }

  return { root, show };
}
