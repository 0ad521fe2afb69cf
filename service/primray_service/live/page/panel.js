// Choices beside the picture: the camera, the stage's variants, the exposure.

import { button, choice, element, field, fill, write } from "../page/base/dom.js";
import { send } from "./server.js";

export function panel() {
  const camera = element("div", {});
  const variants = element("div", { class: "controls" });
  const stops = element("output", {});
  const exposure = element("input", { type: "range", min: -8, max: 8, step: 0.25, value: "0" });
  exposure.addEventListener("input", () => {
    write(stops, signed(Number(exposure.value)));
    send({ do: "exposure", stops: Number(exposure.value) });
  });
  const root = element(
    "section",
    { class: "card controls", "aria-label": "What is looked at" },
    camera,
    element(
      "div",
      { class: "actions" },
      button(["Frame all ", element("kbd", {}, "f")], () => send({ do: "frame" })),
      button(["Reset ", element("kbd", {}, "r")], () => send({ do: "reset" })),
    ),
    element("div", { class: "field exposure" }, field("Exposure, stops", exposure), stops, button("Auto", () => send({ do: "exposure", stops: "auto" }))),
    variants,
  );
  let drawn = "";

  function show(state) {
    const text = JSON.stringify([state.cameras, state.camera, state.moved, state.variants]);
    if (document.activeElement !== exposure && state.exposure !== undefined) {
      write(stops, state.exposure === "auto" ? "auto" : signed(state.exposure));
      if (state.exposure !== "auto") exposure.value = state.exposure;
    }
    if (text === drawn) return;
    drawn = text;
    keepFocus(root, () => {
      fill(camera, cameraField(state));
      fill(variants, (state.variants ?? []).map(variantField));
    });
  }

  return { root, show };
}

function cameraField(state) {
  const own = state.cameras?.includes(state.camera) ? [] : [["", "made for the stage"]];
  const options = [...own, ...(state.cameras ?? []).map((path) => [path, path])];
  const select = choice(options, state.camera ?? "", { "data-key": "camera" });
  select.addEventListener("change", () => send({ do: "camera", path: select.value || null }));
  return field("Camera", select, state.moved ? "moved; its lens is used" : undefined);
}

function variantField(variant) {
  const names = variant.names.map((name) => [name, name]);
  const options = variant.selection ? names : [["", "none"], ...names];
  const select = choice(options, variant.selection, { "data-key": `${variant.prim} ${variant.set}` });
  select.addEventListener("change", () => send({ do: "variant", prim: variant.prim, set: variant.set, name: select.value }));
  return field(`${variant.set} of ${variant.prim}`, select);
}

function signed(stops) {
  return `${stops < 0 ? "" : "+"}${Number(stops).toFixed(2)}`;
}

// Lists are made again; the focus returns to the list that had it.
function keepFocus(root, change) {
  const key = document.activeElement?.dataset?.key;
  change();
  if (key && root.ownerDocument.activeElement === document.body) root.querySelector(`[data-key="${CSS.escape(key)}"]`)?.focus();
}
