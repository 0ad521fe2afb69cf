// What a user takes from the page: the picture as a file, the camera as USD, the command that renders what is shown.

import { button, element, fill, say } from "../page/base/dom.js";
import { refuse } from "./server.js";

export function takeAway() {
  const copied = element("div", { class: "copied" });

  async function copy(from, what) {
    const answer = await fetch(from, { cache: "no-store" });
    if (!answer.ok) return refuse(await answer.json());
    const text = await answer.text();
    try {
      await navigator.clipboard.writeText(text);
      fill(copied);
      say(`${what} is copied.`);
      fill(copied, element("p", { class: "note" }, `${what} is copied.`));
    } catch {
      const shown = element("textarea", { readonly: true, rows: 8, "aria-label": what, value: text });
      fill(copied, shown); // a browser that gives no page its clipboard
      shown.select();
    }
    return undefined;
  }

  const root = element(
    "section",
    { class: "card controls", "aria-label": "To take away" },
    element(
      "div",
      { class: "actions" },
      save("png", "Save picture"),
      save("exr", "Save EXR"),
      button("Copy camera as USD", () => copy("camera", "The camera")),
      button("Copy command", () => copy("shell", "The command")),
    ),
    copied,
  );
  return { root };
}

function save(kind, label) {
  return button(label, () => {
    const link = element("a", { href: `saved/${kind}`, download: "" });
    document.body.append(link);
    link.click();
    link.remove();
  });
}
