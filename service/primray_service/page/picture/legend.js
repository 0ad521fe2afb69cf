// The meaning of a view's colours: of the server's error views by the Preview-Scale header, of layers by paint().

import { element, fill } from "../base/dom.js";
import * as format from "../base/format.js";

export function legend() {
  const root = element("p", { class: "legend", hidden: true });

  // log10;low=1e-3;high=1e0;unit=radiance;map=viridis;...
  function show(scale) {
    const found = Object.fromEntries((scale ?? "").split(";").map((part) => part.split("=")));
    const [low, high] = [Number(found.low), Number(found.high)];
    const unit = found.unit === "radiance" ? "standard error, in the picture’s units" : "standard error, relative to the pixel";
    showScale(low > 0 && high > low ? { low: format.error(low), high: format.error(high), unit: `${unit}; grey: not known yet` } : null);
  }

  // The scale is {low, high, unit, map}; `map` is "" if the colours are no scale.
  function showScale(scale) {
    root.hidden = !scale;
    if (!scale) return;
    const { low, high, unit, map = "viridis" } = scale;
    fill(root, low && element("span", {}, low), map && element("i", { class: map }), high && element("span", {}, map ? high : `to ${high}`), element("span", { class: "soft" }, unit));
  }

  return { root, show, showScale };
}
