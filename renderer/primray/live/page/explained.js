// What the light of a pixel is made of, as tables: by light, kind of path, bounce, and the prim that sends it.

import { RARE, shareWords } from "./figures.js";

// Shows `explained` of a viewer's state in `root`, which is hidden where there is none. All of it is set as text.
export function explanation(root) {
  let drawn = "";

  function show(explained) {
    const text = JSON.stringify(explained ?? null);
    if (text === drawn) return;
    drawn = text;
    root.hidden = !explained;
    root.dataset.phase = explained?.phase ?? "";
    root.replaceChildren(...(explained ? content(explained) : []));
  }

  return { show };
}

function content(explained) {
  if (explained.phase === "explaining") return [made("p", "Explaining the pixel: its scene is prepared beside the picture")];
  if (explained.phase === "failed") return [made("p", `The pixel cannot be explained: ${explained.problem.code}: ${explained.problem.message}`)];
  const [x, y] = explained.pixel;
  const outdated = explained.outdated ? "; the picture has changed since" : "";
  const title = made("strong", `Pixel ${x} ${y}`);
  const about = made("p", `${explained.samples} samples: light ${color(explained.value, explained.error)}, alpha ${Number(explained.alpha.toPrecision(3))}${outdated}`);
  const tables = made("div", "", "splits");
  tables.append(...explained.splits.map(table));
  return [title, about, tables, ...(explained.rare ? [made("p", `? ${RARE}`, "note")] : [])];
}

function table({ title, parts, more, more_share: rest }) {
  const found = made("table", "");
  found.append(made("caption", title));
  for (const { name, share, error, rare } of parts) {
    found.append(row(shareWords(share, error, rare), name));
  }
  if (more > 0) found.append(row(shareWords(rest, null), `${more} more`));
  return found;
}

function row(share, name) {
  const found = made("tr", "");
  found.append(made("td", share), made("th", name));
  found.lastChild.scope = "row";
  return found;
}

function color(values, errors) {
  return values.map((value, channel) => `${brief(value)}${errors ? ` ± ${Number(errors[channel].toPrecision(2))}` : ""}`).join(", ");
}

function made(tag, text, name = "") {
  const found = document.createElement(tag);
  found.textContent = text;
  if (name) found.className = name;
  return found;
}

const brief = (value) => Number(value.toPrecision(4));
