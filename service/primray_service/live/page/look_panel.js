// How pictures are shown: exposure, view transform, denoised or not, or another output than the light.

import { button, choice, element, field, fill, ticked, write } from "../page/base/dom.js";
import { keepFocus } from "./focus.js";
import { send } from "./server.js";

const OUTPUTS = {
  depth: "depth",
  normal: "normals",
  albedo: "albedo",
  emission: "emission",
  prim: "prims",
  instance: "instances",
  material: "materials",
};

export function lookPanel() {
  const exposure = exposureField();
  const output = element("div", {});
  const display = element("div", { class: "controls" });
  const denoise = element("input", { type: "checkbox" });
  denoise.addEventListener("change", () => send({ do: "denoise", on: denoise.checked }));
  const denoised = ticked("Denoised preview", denoise, "Open Image Denoise; the picture that is saved has both");
  const root = element("section", { class: "card controls", "aria-label": "How it is shown" }, output, exposure.root, denoised, display);
  let drawn = "";

  function show(state) {
    exposure.show(state);
    if (!state.can) return;
    denoised.hidden = !state.can.denoise;
    denoise.checked = state.denoise;
    const text = JSON.stringify([state.can, state.aov, state.display]);
    if (text === drawn) return;
    drawn = text;
    keepFocus(root, () => {
      fill(output, outputField(state));
      fill(display, displayFields(state));
    });
  }

  return { root, show };
}

function exposureField() {
  const stops = element("output", {});
  const exposure = element("input", { type: "range", min: -8, max: 8, step: 0.25, value: "0" });
  exposure.addEventListener("input", () => {
    write(stops, signed(Number(exposure.value)));
    send({ do: "exposure", stops: Number(exposure.value) });
  });
  const auto = button("Auto", () => send({ do: "exposure", stops: "auto" }));

  function show(state) {
    if (document.activeElement === exposure || state.exposure === undefined) return;
    write(stops, state.exposure === "auto" ? "auto" : signed(state.exposure));
    if (state.exposure !== "auto") exposure.value = state.exposure;
  }

  return { root: element("div", { class: "field exposure" }, field("Exposure, stops", exposure), stops, auto), show };
}

function outputField(state) {
  const options = [["", "picture"], ...state.can.aovs.map((name) => [name, OUTPUTS[name] ?? name])];
  const select = choice(options, state.aov ?? "", { "data-key": "output" });
  select.addEventListener("change", () => send({ do: "aov", name: select.value || null }));
  return field("Output", select);
}

function displayFields({ can, display }) {
  const [first] = Object.keys(can.displays);
  const chosen = { ...display };
  const change = (name, value) => {
    chosen[name] = value || null;
    if (name === "display") chosen.view = null;
    send({ do: "display", ...chosen });
  };
  const list = (label, name, options) => {
    const select = choice(options, display[name] ?? options[0][0], { "data-key": name });
    select.addEventListener("change", () => change(name, select.value));
    return field(label, select);
  };
  const views = can.displays[display.display ?? first] ?? [];
  const pairs = (names) => names.map((name) => [name, name]);
  return [
    Object.keys(can.displays).length > 1 && list("Display", "display", pairs(Object.keys(can.displays))),
    views.length > 1 && list("View transform", "view", pairs(views)),
    can.looks.length > 0 && list("Look", "look", [["", "the view's"], ...pairs(can.looks)]),
  ];
}

const signed = (stops) => `${stops < 0 ? "" : "+"}${Number(stops).toFixed(2)}`;
