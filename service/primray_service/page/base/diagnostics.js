// Diagnostics of a scene, with the prims that they concern: grouped by severity, prim or kind, filtered by words.

import { choice, element, field, fill, write } from "./dom.js";
import { plural } from "./format.js";

const SHOWN = 300; // rows; a scene can have a warning for each of 100,000 prims
const ORDER = { error: 0, warning: 1, info: 2 };

export function diagnostics() {
  const filter = element("input", { type: "search", placeholder: "prim, kind or words", on: { input: draw } });
  const by = choice([["severity", "severity"], ["prim", "prim"], ["code", "kind"]], "severity", { on: { change: draw } });
  const list = element("div", { class: "found" });
  const heading = element("h2", {});
  const controls = element("div", { class: "bar" }, field("Filter", filter), field("Group by", by));
  const root = element("section", { class: "card diagnostics", "aria-label": "Diagnostics" }, heading, controls, list);
  let rows = [];
  let drawn = "";

  function show(given) {
    const text = JSON.stringify(given);
    if (text === drawn) return;
    drawn = text;
    rows = given.map((row) => ({ severity: "warning", prim: "", code: "", kind: "", attribute: "", detail: "", ...row }));
    draw();
  }

  function draw() {
    const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const matching = rows.filter((row) => {
      const text = `${row.prim} ${row.code} ${row.kind} ${row.attribute} ${row.detail}`.toLowerCase();
      return words.every((word) => text.includes(word));
    });
    write(heading, rows.length === 0 ? "Nothing to report about the scene" : `${plural(rows.length, "note")} on the scene: ${counted(rows)}`);
    controls.hidden = rows.length < 2;
    const groups = new Map();
    if (by.value === "severity") matching.sort((a, b) => rank(a) - rank(b));
    for (const row of matching.slice(0, SHOWN)) {
      const name = row[by.value] || "the whole scene";
      groups.set(name, [...(groups.get(name) ?? []), row]);
    }
    fill(
      list,
      [...groups].map(([name, members]) => group(name, members)),
      matching.length > SHOWN && element("p", { class: "note" }, `${plural(matching.length - SHOWN, "more note")}: narrow the filter to see them.`),
      rows.length > 0 && matching.length === 0 && element("p", { class: "note" }, "None of the notes matches."),
    );
  }

  function group(name, members) {
    members.sort((a, b) => rank(a) - rank(b));
    const place = (row) => row.prim || "the whole scene";
    return element(
      "div",
      { class: "group" },
      element("h3", {}, by.value === "severity" ? `${name} (${members.length})` : element("code", {}, name)),
      element(
        "ul",
        {},
        members.map((row) =>
          element(
            "li",
            { data: { severity: row.severity } },
            by.value !== "severity" && element("span", { class: "severity" }, `${row.severity}: `),
            by.value !== "code" && element("span", { class: "kind" }, row.code),
            by.value === "severity" && " ",
            by.value !== "prim" && element("code", {}, place(row)),
            " ",
            row.attribute && element("code", {}, row.attribute),
            row.attribute && " ",
            element("span", {}, row.detail),
          ),
        ),
      ),
    );
  }

  return { root, show };
}

const rank = ({ severity }) => ORDER[severity] ?? 1;

// "1 error, 2 warnings, 3 info"
function counted(rows) {
  const count = (severity) => rows.filter((row) => row.severity === severity).length;
  const [errors, warnings] = [count("error"), count("warning")];
  const rest = rows.length - errors - warnings;
  return [errors && plural(errors, "error"), warnings && plural(warnings, "warning"), rest && `${rest} info`].filter(Boolean).join(", ");
}
