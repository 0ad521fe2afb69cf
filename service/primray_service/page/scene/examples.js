// The project's example scenes: files beside the page, sent as if they had been dropped.

import { call } from "../base/api.js";
import { element } from "../base/dom.js";

const EXAMPLES = [
  ["materials", "Materials", "From mirror to matt, from plastic to metal"],
  ["interiors", "Glass and wax", "Light that goes through: wax, amber, milk, skin"],
  ["forest", "A forest", "Sixty instances of a tree and a stone"],
];

// `onChosen(files)` is called as after a drop; `onFailure(failure)` if the files cannot be fetched.
export function examples(onChosen, onFailure) {
  const card = ([name, title, words]) =>
    element(
      "button",
      { type: "button", class: "example", on: { click: () => choose(name) } },
      element("img", { src: `/page/examples/${name}.jpg`, alt: "", width: 400, height: 225 }),
      element("strong", {}, title),
      element("span", { class: "soft" }, words),
    );

  async function choose(name) {
    try {
      const response = await call("GET", `/page/examples/${name}.usda`, { accept: "*/*" });
      const file = new File([await response.blob()], `${name}.usda`);
      onChosen([{ path: file.name, file }]);
    } catch (failure) {
      onFailure(failure);
    }
  }

  return element("section", { class: "examples", "aria-label": "Examples" }, element("h2", {}, "Or start with an example"), element("div", { class: "example-cards" }, EXAMPLES.map(card)));
}
