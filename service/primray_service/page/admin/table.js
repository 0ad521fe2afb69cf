// A table under its heading. Rows are kept by their keys and only replaced where what they say differs, so that a control that is
// in use stays as it is while the page looks again.

import { element, fill } from "../base/dom.js";

export function table(caption, columns, empty) {
  const body = element("tbody", {});
  const head = element("thead", {}, element("tr", {}, columns.map((name) => element("th", { scope: "col" }, name))));
  const note = element("p", { class: "note", hidden: true }, empty);
  const scroll = element("div", { class: "table-scroll", tabindex: "0", role: "region", "aria-label": caption }, element("table", {}, head, body));
  const root = element("section", { class: "card admin" }, element("h2", {}, caption), scroll, note);
  const rows = new Map(); // by key: what it says, and its row

  // `found`: [key, what it says, a function that makes its cells]
  function show(found) {
    const kept = found.map(([key, says, cells]) => {
      const known = rows.get(key);
      const inUse = known?.row.contains(document.activeElement) && document.activeElement.matches("input");
      if (known && (known.says === says || inUse)) return [key, known];
      return [key, { says, row: element("tr", {}, cells().map((cell) => element("td", {}, cell))) }];
    });
    rows.clear();
    for (const [key, row] of kept) rows.set(key, row);
    const wanted = kept.map(([, { row }]) => row);
    if (wanted.length !== body.children.length || wanted.some((row, place) => body.children[place] !== row)) fill(body, wanted);
    note.hidden = found.length > 0;
    scroll.hidden = found.length === 0;
  }

  return { root, show };
}
