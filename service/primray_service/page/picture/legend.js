// What the colours of a view mean: of the server's error views from the answer's Preview-Scale, of layers as paint() says.

import { element, fill } from "../base/dom.js";
import * as format from "../base/format.js";

export function legend() {
  const root = element("p", { class: "legend", hidden: true });

  // log10;low=1e-3;high=1e0;unit=radiance;map=viridis;...
  function show(scale) {
    const found = Object.fromEntries((scale ?? "").split(";").map((part) => part.split("=")));
    const [low, high] = [Number(found.low), Number(found.high)];
    const unit = found.unit === "radiance" ? "standard error, in the picture’s units" : "standard error, relative to the pixel";
    tell(low > 0 && high > low ? { low: format.error(low), high: format.error(high), unit: `${unit}; grey: not known yet` } : null);
  }

  // {low, high, unit, map}; `map` is "" where colours are no scale.
  function tell(scale) {
    root.hidden = !scale;
    if (!scale) return;
    const { low, high, unit, map = "viridis" } = scale;
    fill(root, low && element("span", {}, low), map && element("i", { class: map }), high && element("span", {}, map ? high : `to ${high}`), element("span", { class: "soft" }, unit));
  }

  return { root, show, tell };
}
