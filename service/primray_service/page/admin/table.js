// A table under its heading. Rows are found by their keys and replaced only if their content differs, so that a control in use
// stays as it is when the page is refreshed.

import { element, fill } from "../base/dom.js";

export function table(caption, columns, empty) {
  const body = element("tbody", {});
  const head = element("thead", {}, element("tr", {}, columns.map((name) => element("th", { scope: "col" }, name))));
  const note = element("p", { class: "note", hidden: true }, empty);
  const scroll = element("div", { class: "table-scroll", tabindex: "0", role: "region", "aria-label": caption }, element("table", {}, head, body));
  const root = element("section", { class: "card admin" }, element("h2", {}, caption), scroll, note);
  const rows = new Map(); // by key: the content, and its row

  // `found` is a list of [key, content, function that makes the cells].
  function show(found) {
    const entries = found.map(([key, says, cells]) => {
      const known = rows.get(key);
      const inUse = known?.row.contains(document.activeElement) && document.activeElement.matches("input");
      if (known && (known.says === says || inUse)) return [key, known];
      return [key, { says, row: element("tr", {}, cells().map((cell) => element("td", {}, cell))) }];
    });
    rows.clear();
    for (const [key, row] of entries) rows.set(key, row);
    const wanted = entries.map(([, { row }]) => row);
    if (wanted.length !== body.children.length || wanted.some((row, place) => body.children[place] !== row)) fill(body, wanted);
    note.hidden = found.length > 0;
    scroll.hidden = found.length === 0;
  }

  return { root, show };
}
