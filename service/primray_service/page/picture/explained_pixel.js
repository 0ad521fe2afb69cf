// What one pixel's light is made of, as `primray explain` says: four tables of parts that add up to it, each with its error, and
// the paths that make most of its noise.

import { jobPath, send } from "../base/api.js";
import { button, element, fill, say } from "../base/dom.js";
import * as format from "../base/format.js";
import { problemBox } from "../base/problem_box.js";
import { RARE, shareWords } from "../live/figures.js";

const SPLITS = [["light", "By light"], ["kind", "By kind of path"], ["bounce", "By bounce"], ["prim", "By the prim that sends it here"]];
const MOST = 8; // rows of a table
const LEAST = 5e-4; // share of the pixel, or its error, that has a row
const PATHS = 3;

// `onClosed` is called when it is closed by its button or by Escape in it.
export function explainedPixel(job, onClosed) {
  const title = element("h2", {});
  const body = element("div", { class: "explained-body" });
  const root = element(
    "section",
    { class: "card explained", hidden: true, "aria-label": "The light of a pixel", on: { keydown: onKey } },
    element("div", { class: "explained-head" }, title, button("Close", leave, { class: "quiet" })),
    body,
  );
  let asked = 0; // only the answer to the last question counts

  function onKey(event) {
    if (event.key !== "Escape") return;
    event.preventDefault();
    leave();
  }

  function leave() {
    if (close()) onClosed();
  }

  // Returns whether it was open.
  function close() {
    const was = !root.hidden;
    asked += 1;
    root.hidden = true;
    return was;
  }

  async function ask(frame, [x, y]) {
    const mine = ++asked;
    root.hidden = false;
    fill(title, `Pixel ${x}, ${y}`);
    fill(body, element("p", { class: "note", role: "status" }, element("span", { class: "pulse" }), " Its samples are rendered again"));
    try {
      const found = await send("POST", jobPath(job, `/frames/${frame}/explain`), { x, y });
      if (mine !== asked) return;
      fill(body, partsOf(found));
      const first = found.splits.light[0];
      say(`Pixel ${x}, ${y} is explained${first ? `: ${shareOf(first)} of its light is from ${first.name}` : ": it has no light"}.`);
    } catch (failure) {
      if (!failure.problem) throw failure;
      if (mine === asked) fill(body, problemBox(failure.problem, { retryAfter: failure.retryAfter, retry: failure.problem.retryable ? () => ask(frame, [x, y]) : null }));
    }
  }

  return {
    root,
    ask,
    close,
    // Says why nothing is asked.
    refuse: (why) => {
      asked += 1;
      root.hidden = false;
      fill(title, "The light of a pixel");
      fill(body, element("p", { class: "note", role: "status" }, why));
    },
  };
}

function partsOf(found) {
  const hasRare = Object.values(found.splits).flat().some(({ rare }) => rare);
  return [
    element("dl", { class: "facts" }, facts(found)),
    element("div", { class: "splits" }, SPLITS.map(([name, caption]) => table(caption, found.splits[name], found.more[name]))),
    hasRare && element("p", { class: "note" }, `?  Paths ${RARE}.`),
    noise(found.noise),
  ];
}

function facts({ value, error, shown, samples, renders }) {
  const rows = [
    ["Light", `${color(value)}${error ? ` ± ${color(error)}` : ""}`],
    ["Shows", shown ? [shown.prim, shown.instance && `in ${shown.instance}`, shown.material && `with ${shown.material}`].filter(Boolean).join(" ") : "no surface"],
    ["Rendered", `${format.plural(samples, "sample")}, and ${format.plural(renders, "time")} more with other seeds`],
  ];
  return rows.map(([name, words]) => [element("dt", {}, name), element("dd", {}, words)]);
}

function table(caption, parts, more) {
  const shown = parts.filter((part) => Math.max(part.share, part.share_error ?? 0) >= LEAST).slice(0, MOST);
  const left = parts.length - shown.length + more;
  const rest = Math.max(0, sum(parts) > 0 ? 1 - sum(shown) : 0); // what the server leaves out, too: shares add up to 1
  return element(
    "table",
    {},
    element("caption", {}, caption),
    element("thead", {}, element("tr", {}, ["Share", "R, G, B", "From"].map((name) => element("th", { scope: "col" }, name)))),
    element(
      "tbody",
      {},
      shown.map((part) => element("tr", {}, element("td", {}, shareOf(part)), element("td", {}, color(part.value)), element("th", { scope: "row" }, part.name))),
      left > 0 && element("tr", {}, element("td", {}, format.percentOf(rest)), element("td", {}), element("th", { scope: "row" }, `${left} more`)),
      parts.length === 0 && element("tr", {}, element("td", { colspan: "3" }, "No light")),
    ),
  );
}

const shareOf = ({ share, share_error: error, rare }) => shareWords(share, error, rare);

// Names the paths with the largest shares of the noise.
function noise(paths) {
  const worst = paths.filter(({ random }) => !random);
  if (sum(worst) <= 0) return null;
  return element(
    "div",
    { class: "worst" },
    element("h3", {}, `Noise: the ${format.plural(worst.length, "worst path makes", "worst paths make")} ${Math.round(100 * sum(worst))} % of it`),
    element("ol", {}, worst.slice(0, PATHS).map(({ share, words }) => element("li", {}, `${format.percentOf(share)}: ${words}`))),
  );
}

const sum = (parts) => parts.reduce((total, { share }) => total + share, 0);

const color = (values) => values.map((value) => String(Number(value.toPrecision(4)))).join(", ");
