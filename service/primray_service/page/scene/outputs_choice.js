// Choice of a render's outputs: the product of the stage, AOVs, a denoised picture; and of the purposes that are rendered.

import { choice, element, field, labelled, ticked } from "../base/dom.js";

const LOOKED_AT = ["depth", "normal", "albedo", "prim"]; // useful in a viewer, for stages that define no products
const PURPOSES = ["default", "render", "proxy", "guide"];
const USUAL = ["default", "render"];
const [BEAUTY, ALL] = ["beauty", "*"]; // the first product; all products
const productOf = (was) => (!was?.products || was.products[0] === BEAUTY ? "" : was.products[0]);

// `was` are the settings of the job that the choice begins with.
export function outputsChoice(facts, aovs, was = null) {
  const product = facts.products.length > 1 ? choice([["", "the first of the render settings"], [ALL, "all, each under its own name"], ...facts.products.map(({ path }) => [path, path])], productOf(was)) : null;
  const denoise = element("input", { type: "checkbox", checked: was?.denoise });
  const ordered = facts.products.some(({ vars }) => vars.length > 0);
  const ticks = new Map(aovs.map(({ name, meaning }) => [name, tick(name, meaning, was?.aovs ? was.aovs.includes(name) : !ordered && LOOKED_AT.includes(name))]));
  const others = element("input", { type: "text", value: (was?.aovs ?? []).filter((name) => !ticks.has(name)).join(", "), placeholder: "primvar:NAME, labels:TAXONOMY, C<RD>.*", spellcheck: "false", autocomplete: "off" });
  const which = ordered ? choice([["ordered", "as the stage orders"], ["chosen", "these"]], was?.aovs ? "chosen" : "ordered", { on: { change: arrange } }) : null;
  const purposes = new Map(PURPOSES.map((name) => [name, tick(name, "", (was?.purposes ?? USUAL).includes(name))]));
  const errors = element("input", { type: "checkbox", checked: was?.aov_errors });
  const view = element("input", { type: "text", value: was?.view ?? "", placeholder: "the stage's, else the default", spellcheck: "false", autocomplete: "off" });
  const exposure = element("input", { type: "text", value: was?.exposure ?? "", placeholder: "0", pattern: "auto|[-+]?[0-9.]+", spellcheck: "false", autocomplete: "off" });
  const half = element("input", { type: "text", value: (was?.half ?? []).join(", "), placeholder: "none", spellcheck: "false", autocomplete: "off" });
  const compression = element("input", { type: "text", value: was?.compression ?? "", placeholder: "zip", spellcheck: "false", autocomplete: "off" });
  const list = element("div", { class: "ticks" }, [...ticks.values()].map(({ root }) => root));
  const more = field("And by name", others);
  const root = element(
    "details",
    { class: "outputs-choice" },
    element("summary", {}, "Outputs and purposes"),
    element(
      "div",
      { class: "columns" },
      product && field("Product", product),
      element("fieldset", {}, element("legend", {}, "Denoised picture"), ticked("add one, with its own error", denoise), element("small", {}, "by primray[denoise], where the server has it")),
      field("View", view, "of OpenColorIO, for the PNG and what is seen here"),
      field("Exposure", exposure, "stops, or auto"),
      field("Halves in the EXR", half, "rgba, stderr, a part's name, all or none"),
      field("Compression of the EXR", compression, "zip, piz, dwaa:45, ..."),
      element("fieldset", {}, element("legend", {}, "Purposes that are drawn"), element("div", { class: "ticks" }, [...purposes.values()].map(({ root }) => root))),
    ),
    element("fieldset", {}, element("legend", {}, "AOVs, as parts of the EXR"), which && labelled("Which AOVs", which), list, more, ticked("with the standard errors of those that are means of samples", errors)),
  );

  function arrange() {
    list.hidden = more.hidden = which?.value === "ordered";
  }

  function settings() {
    const drawn = [...purposes].filter(([, { input }]) => input.checked).map(([name]) => name);
    const own = others.value.split(",").map((name) => name.trim()).filter(Boolean);
    const chosen = [...ticks].filter(([, { input }]) => input.checked).map(([name]) => name);
    return {
      ...(product && { products: [product.value || BEAUTY] }),
      denoise: denoise.checked || null, // the stage may ask for one
      ...(view.value.trim() || was?.view ? { view: view.value.trim() || null } : {}),
      ...(exposure.value.trim() || was?.exposure ? { exposure: stopsOf(exposure.value.trim()) } : {}),
      ...(half.value.trim() || was?.half?.length ? { half: half.value.split(",").map((name) => name.trim()).filter(Boolean) } : {}),
      ...(compression.value.trim() || was?.compression ? { compression: compression.value.trim() || null } : {}),
      aov_errors: errors.checked,
      aovs: which?.value === "ordered" ? null : [...chosen, ...own],
      purposes: drawn.length === 0 || drawn.join() === USUAL.join() ? null : drawn,
    };
  }

  arrange();
  return { root, settings };
}

const stopsOf = (text) => (text === "" ? null : text === "auto" ? text : Number(text));

function tick(name, meaning, checked) {
  const input = element("input", { type: "checkbox", checked });
  return { input, root: ticked(name.replaceAll("_", " "), input, meaning) };
}
