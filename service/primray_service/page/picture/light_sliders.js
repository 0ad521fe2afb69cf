// Sliders of a picture's lights: how bright and of which colour each is in the mix, its error, and the command that makes it.

import { button, element, fill, labelled, write } from "../base/dom.js";
import * as format from "../base/format.js";

const MOST_STOPS = 6; // each way; the lowest turns a light off
const STEP = 0.25;

// `onChange` is called when a weight has changed. `weights` is a Map of [r, g, b] by the light's name.
export function lightSliders(weights, onChange) {
  const rows = element("div", { class: "lights" });
  const [error, command] = [element("p", { class: "note", role: "status" }), element("code", { class: "mix-command" })];
  const reset = button("Reset lights", () => {
    weights.clear();
    list(names);
    changed();
  }, { class: "quiet" });
  const root = element("section", { class: "mix", hidden: true, "aria-label": "Lights of the picture" }, rows, error, command, reset);
  let names = [];

  function changed() {
    const words = names.filter((name) => weights.has(name)).map((name) => `${name}=${weights.get(name).map((w) => Number(w.toPrecision(4))).join(",")}`);
    write(command, words.length > 0 ? `primray relight PICTURE.exr --mix "${words.join(" ")}"` : "");
    onChange();
  }

  function list(of) {
    names = of;
    fill(rows, of.map(row));
  }

  function row(name) {
    const intensity = labelled(`Intensity of ${name}, stops`, element("input", { type: "range", min: -MOST_STOPS, max: MOST_STOPS, step: STEP, value: "0", on: { input: weigh } }));
    const color = labelled(`Colour of ${name}`, element("input", { type: "color", value: "#ffffff", on: { input: weigh } }));
    const stops = element("output", {}, "0");

    function weigh() {
      const value = Number(intensity.value);
      const factor = value > -MOST_STOPS ? 2 ** value : 0;
      const tint = [1, 3, 5].map((at) => linear(Number.parseInt(color.value.slice(at, at + 2), 16) / 255));
      write(stops, factor === 0 ? "off" : `${value > 0 ? "+" : ""}${value}`);
      intensity.setAttribute("aria-valuetext", factor === 0 ? "off" : `${value} stops`);
      weights.set(name, tint.map((part) => part * factor));
      changed();
    }

    return element("div", { class: "light" }, element("span", {}, name), intensity, stops, color);
  }

  return {
    root,
    // Lists the lights of a mix, or hides the sliders without one.
    show: (mix) => {
      root.hidden = !mix;
      if (mix && mix.lights.join() !== names.join()) list(mix.lights);
    },
    tell: (relmse) => write(error, relmse ? `Relative error (relMSE) of the mix: ${format.error(relmse.value)} (${format.error(relmse.low)} to ${format.error(relmse.high)})` : ""),
  };
}

// IEC 61966-2-1, from the encoding of sRGB.
const linear = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
