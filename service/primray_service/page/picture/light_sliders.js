// Sliders of a picture's lights: how bright and of which colour each is in the mix, its error, and the command that makes it.

import { button, element, fill, write } from "../base/dom.js";
import * as format from "../base/format.js";
import { lightRows, weightWords } from "../live/light_rows.js";

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
    const words = names.filter((name) => weights.has(name)).map((name) => `${name}=${weightWords(weights.get(name)).join(",")}`);
    write(command, words.length > 0 ? `primray relight PICTURE.exr --mix "${words.join(" ")}"` : "");
    onChange();
  }

  function list(of) {
    names = of;
    fill(rows, lightRows(names, weights, changed));
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
