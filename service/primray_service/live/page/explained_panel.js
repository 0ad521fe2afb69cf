// The pixel that was clicked with Ctrl, explained.

import { button, element, say } from "../page/base/dom.js";
import { explanation } from "../page/live/explained.js";
import { send } from "./server.js";

export function explainedPanel() {
  const tables = element("div", { class: "explained", id: "explained" });
  const close = button(["Close ", element("kbd", {}, "Esc")], () => send({ do: "deselect" }));
  const root = element("section", { class: "card controls", "aria-label": "Explained pixel", hidden: true }, tables, element("div", { class: "actions" }, close));
  const shown = explanation(tables);
  let phase = "";

  function show({ explained }) {
    root.hidden = !explained;
    shown.show(explained);
    const now = explained?.phase ?? "";
    if (now !== phase && now === "explained") say("The pixel is explained.");
    phase = now;
  }

  return { root, show };
}
