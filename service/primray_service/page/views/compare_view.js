// Compares two pictures, or two parts of pictures' files, on top of each other: with a slider between them (a wipe), in
// alternation (a flicker), as their difference, or as that difference in standard errors; with the values of both under the
// cursor.

import { get, jobPath } from "../base/api.js";
import { button, choice, element, field, fill, write } from "../base/dom.js";
import * as format from "../base/format.js";
import { problemBox } from "../base/problem_box.js";
import { TERMINAL } from "../base/words.js";
import { differenceOf, paintDeviations, paintDifference, unlike } from "../layers/difference.js";
import { indexAt } from "../layers/values.js";
import { PICTURE, compareSide } from "../picture/compare_side.js";
import { divider } from "../picture/divider.js";
import { legend } from "../picture/legend.js";
import { EXPOSE_AFTER_S, KEY_STOPS, LOOKS } from "../picture/looks.js";
import { stage } from "../picture/stage.js";
import { nameOf } from "./jobs_view.js";

const MODES = [["split", "Slider"], ["flicker", "Flicker"], ["a", "A"], ["b", "B"], ["difference", "Difference"], ["deviations", "Difference ÷ error"]];
const OF_BOTH = ["difference", "deviations"];
const KEYS = { a: "a", b: "b", w: "split", f: "flicker", d: "difference", s: "deviations" };
const FLICKER_S = 0.7; // slow enough to be safe: at most 3 flashes a second (WCAG 2.3.1)
const SAME = ""; // B shows the same view as A
const OFFERED = 100; // jobs in each list
const LOOK_EVERY_S = 3; // while one of the two is being rendered

export function compareView(root, [first, second]) {
  const trouble = element("div", {});
  const pickers = element("div", { class: "bar" });
  const values = element("output", { class: "values two", "aria-label": "Values of the pixel under the cursor" });
  const keys = { words: "A and B show one picture, Space the other one, W wipes, F flickers, D shows the difference, S the difference in standard errors, E and Shift E change the exposure", press: onKey };
  const board = stage("The two pictures", { onPixel: showPixel, keys });
  const [a, b] = [compareSide(first), compareSide(second)];
  const canvas = element("canvas", {});
  const tags = [element("span", { class: "tag left" }, "A"), element("span", { class: "tag right" }, "B")];
  const line = divider(board, place);
  const colors = legend();
  board.sheet.prepend(a.root, b.root, canvas);
  board.root.append(line.root, ...tags);
  const query = new URLSearchParams(location.hash.split("?")[1]);
  const view = choice([], null, { on: { change: turn } });
  const other = choice([], null, { on: { change: turn } });
  const split = element("input", { type: "range", min: "0", max: "100", step: "0.5", value: "50", on: { input: arrange } });
  const exposure = element("input", { type: "range", min: "-8", max: "8", step: "0.25", value: "0", on: { input: expose } });
  const gain = element("input", { type: "range", min: "0", max: "8", step: "0.5", value: "3", on: { input: expose } });
  const look = choice(LOOKS, "display", { on: { change: draw } });
  const frame = element("input", { type: "number", min: "1", value: "1", step: "1", on: { change: () => load() } });
  const [stops, times] = [element("output", { class: "stops" }, "0"), element("output", { class: "stops" }, "× 8")];
  const mode = element("div", { class: "segments", role: "group", "aria-label": "Show" }, MODES.map(([name, text]) => button(text, () => choose(name), { data: { mode: name } })));
  const numbers = element("dl", { class: "numbers-list" });
  const [splitField, lookField, frameField] = [field("Between A and B", split), field("Look", look), field("Frame, from 1", frame)];
  const gainField = element("div", { class: "field exposure" }, element("label", { for: (gain.id = "gain") }, "Gain of the difference"), gain, times);
  const exposureField = element("div", { class: "field exposure" }, element("label", { for: (exposure.id = "compare-exposure") }, "Exposure, stops"), exposure, stops);
  const picture = element(
    "section",
    { class: "viewer", hidden: true, "aria-label": "The two pictures" },
    board.root,
    element("div", { class: "under" }, element("div", {}, values, colors.root), board.tools),
    mode,
    element("div", { class: "bar" }, field("View", view), field("B shows", other), splitField, gainField, exposureField, lookField, frameField),
    numbers,
  );
  frameField.hidden = true;
  let shown = "split";
  let found = null; // the difference of the two; null if it cannot be computed
  let names = [query.get("view") ?? PICTURE, query.get("b") ?? SAME]; // of the views that A and B show
  let scales = {}; // the meaning of colours: in both pictures, in their difference, in deviations
  let [closed, timer, exposeTimer, flickerTimer, loading, drawing] = [false, 0, 0, 0, 0, 0];
  let isB = false;
  fill(root, element("h1", {}, "Compare"), pickers, trouble, picture);

  function choose(name) {
    shown = name;
    clearInterval(flickerTimer);
    if (name === "flicker") flickerTimer = setInterval(() => flip(!isB), 1000 * FLICKER_S);
    arrange();
  }

  function flip(toB) {
    isB = toB;
    arrange();
  }

  function onKey(key) {
    const name = KEYS[key];
    if (name) choose(name);
    else if (key === " ") choose(shown === "a" ? "b" : "a");
    else if (key === "e" || key === "E") {
      exposure.value = String(Number(exposure.value) + (key === "e" ? KEY_STOPS : -KEY_STOPS));
      expose();
    } else return false;
    return true;
  }

  function place(percent) {
    split.value = String(percent);
    arrange();
  }

  function expose() {
    const value = Number(exposure.value);
    write(stops, `${value > 0 ? "+" : ""}${value}`);
    exposure.setAttribute("aria-valuetext", `${value} stops`);
    const factor = 2 ** Number(gain.value);
    write(times, `× ${format.error(factor)}`);
    gain.setAttribute("aria-valuetext", `${factor} times`);
    clearTimeout(exposeTimer);
    exposeTimer = setTimeout(draw, 1000 * EXPOSE_AFTER_S);
  }

  async function start() {
    try {
      const { items } = await get(`/v1/jobs?limit=${OFFERED}`);
      for (const { id } of [a, b]) {
        if (id && !items.some((job) => job.id === id)) items.unshift(await get(jobPath(id)));
      }
      if (closed) return;
      offer(items);
      await load();
    } catch (failure) {
      if (!failure.problem || closed) return;
      fill(trouble, problemBox(failure.problem, { retry: start }));
    }
  }

  function offer(items) {
    const options = [["", "choose a job"], ...items.map((job) => [job.id, `${nameOf(job)} · ${format.when(job.created_at)}`])];
    const list = (name, side, go) => field(name, choice(options, side.id ?? "", { on: { change: (event) => go(event.target.value) } }));
    const swap = button("Swap", () => go(b.id ?? "", a.id ?? ""));
    fill(pickers, list("A", a, (id) => go(id, b.id ?? "")), list("B", b, (id) => go(a.id ?? "", id)), swap);
    if (items.length === 0) fill(trouble, element("p", { class: "note" }, "There is no job to compare yet."));
  }

  // The address names what is compared, so that it can be saved and sent to others.
  function address(one, two) {
    const shows = new URLSearchParams([...(names[0] === PICTURE ? [] : [["view", names[0]]]), ...(names[1] === SAME ? [] : [["b", names[1]]])]).toString();
    return `#/compare/${encodeURIComponent(one || "-")}${two ? `/${encodeURIComponent(two)}` : ""}${shows && `?${shows}`}`;
  }

  function go(one, two) {
    location.hash = address(one, two);
  }

  function turn() {
    names = [view.value, other.value];
    history.replaceState(null, "", address(a.id, b.id));
    load();
  }

  async function load() {
    clearTimeout(timer);
    if (!a.id || !b.id) {
      fill(trouble, element("p", { class: "note" }, "Choose two jobs, or one job twice to compare two of its parts."));
      return;
    }
    const mine = ++loading;
    try {
      const number = Math.round(Number(frame.value)) || 1;
      const changed = await Promise.all([a.load(number, names[0]), b.load(number, names[1] || names[0])]);
      if (closed || mine !== loading) return;
      const most = Math.max(...[a, b].map(({ job }) => job.progress?.frames?.total ?? 1));
      frameField.hidden = most < 2;
      frame.max = String(most);
      offerViews();
      if (changed.some(Boolean)) {
        found = canDiffer() ? differenceOf(a.layer, b.layer) : null;
        fill(numbers, found?.facts.map(([name, text]) => element("div", {}, element("dt", {}, name), element("dd", {}, text))));
      }
      fill(trouble, notes());
      if (changed.some(Boolean)) await draw();
      if ([a, b].some(({ job }) => !TERMINAL.has(job.state))) timer = setTimeout(load, 1000 * LOOK_EVERY_S);
    } catch (failure) {
      if (closed || mine !== loading) return;
      fill(trouble, problemBox(failure.problem ?? { title: "The two cannot be compared", detail: failure.message }, { retry: load }));
    }
  }

  // Lists the views that A and B have; a view that the address names is listed even if neither has it.
  function offerViews() {
    const listed = (all, name) => (all.includes(name) ? all : [...all, name]).map((each) => [each, each]);
    options(view, listed(a.names, names[0]), names[0]);
    options(other, [[SAME, "the same"], ...listed(b.names, names[1] || PICTURE)], names[1]);
  }

  const canDiffer = () => Boolean(a.layer && b.layer) && unlike(a.layer, b.layer) === "";

  function notes() {
    const lacking = [["A", a, names[0]], ["B", b, names[1] || names[0]]].filter(([, { layer }]) => !layer).map(([side, , name]) => `${side} has no “${name}”.`);
    const reason = a.layer && b.layer ? unlike(a.layer, b.layer) : "";
    const fitted = size(a) !== size(b) ? " Both are shown at the same size, each in its own aspect ratio." : "";
    const going = [a, b].some(({ job }) => !TERMINAL.has(job.state));
    return [
      ...lacking.map((text) => element("p", { class: "note" }, text)),
      reason && element("p", { class: "note" }, `${reason}: the difference cannot be computed.${fitted}`),
      going && element("p", { class: "note" }, "At least one of the two is still being rendered: the comparison follows it."),
    ];
  }

  const size = ({ layer }) => `${layer?.fullWidth} × ${layer?.fullHeight}`;

  // The sheet is as large as the larger of the two, in A's aspect ratio.
  function sheetSize() {
    const [one, two] = [a.layer ?? b.layer, b.layer ?? a.layer];
    const scale = Math.max(1, Math.min(two.fullWidth / one.fullWidth, two.fullHeight / one.fullHeight));
    return [one.fullWidth, one.fullHeight].map((side) => Math.round(scale * side));
  }

  async function draw() {
    if (!a.layer && !b.layer) return;
    const mine = ++drawing;
    picture.hidden = false;
    board.size(...sheetSize());
    try {
      const beside = (side) => (canDiffer() ? side.layer : undefined);
      const stopsNow = Number(exposure.value);
      const [ofA, ofB] = await Promise.all([a.show(look.value, stopsNow, beside(b)), b.show(look.value, stopsNow, beside(a))]);
      if (closed || mine !== drawing) return;
      scales = { both: ofA ?? ofB };
      arrange();
    } catch (failure) {
      if (closed) return;
      fill(trouble, problemBox(failure.problem ?? { title: "The two cannot be shown", detail: failure.message }, { retry: draw }));
    }
  }

  function paintBoth() {
    if (!found || !OF_BOTH.includes(shown)) return;
    const factor = 2 ** (Number(exposure.value) + Number(gain.value));
    scales[shown] = shown === "difference" ? paintDifference(canvas, a.layer, found, factor) : paintDeviations(canvas, a.layer, found);
  }

  function arrange() {
    const isThere = (name) => !OF_BOTH.includes(name) || (name === "difference" ? found : found?.deviations);
    if (!isThere(shown)) shown = "split";
    for (const tool of mode.children) {
      tool.disabled = !isThere(tool.dataset.mode);
      tool.setAttribute("aria-pressed", String(tool.dataset.mode === shown));
    }
    const now = shown === "flicker" ? (isB ? "b" : "a") : shown;
    const isColor = [a, b].some(({ layer }) => layer?.kind === "color");
    splitField.hidden = shown !== "split";
    gainField.hidden = shown !== "difference" || !isColor;
    exposureField.hidden = !isColor || shown === "deviations";
    lookField.hidden = !isColor || OF_BOTH.includes(shown);
    tags[0].hidden = a.root.hidden = !["split", "a"].includes(now);
    tags[1].hidden = b.root.hidden = !["split", "b"].includes(now);
    canvas.hidden = !OF_BOTH.includes(shown);
    paintBoth();
    colors.showScale(scales[OF_BOTH.includes(shown) ? shown : "both"] ?? null);
    b.root.style.clipPath = shown === "split" ? `inset(0 0 0 ${split.value}%)` : "";
    split.setAttribute("aria-valuetext", `A to ${split.value} %, B after`);
    picture.dataset.shown = shown;
    line.show(shown === "split" && !picture.hidden, Number(split.value));
  }

  function showPixel(at) {
    if (!at || picture.hidden) {
      write(values, "");
      return "";
    }
    const [ofA, ofB] = [a, b].map((side) => side.wordsOf(at, sheetSize()));
    const deviation = found?.deviations?.[indexAt(a.layer, ...at)];
    const apart = Number.isFinite(deviation) ? `${format.error(deviation)} standard errors apart` : "";
    const described = [ofA && `A ${ofA}`, ofB && `B ${ofB}`, apart].filter(Boolean);
    fill(values, element("span", {}, `x ${at[0]}, y ${at[1]}`), described.map((words) => element("span", { class: "numbers" }, words)));
    return `Pixel ${at[0]}, ${at[1]}: ${described.join(", ")}`;
  }

  start();
  return () => {
    closed = true;
    clearTimeout(timer);
    clearTimeout(exposeTimer);
    clearInterval(flickerTimer);
    line.close();
    board.close();
    a.close();
    b.close();
  };
}

// Sets the options of a list; equal options are left alone, since the list may be open.
function options(list, wanted, chosen) {
  const text = JSON.stringify(wanted);
  if (list.dataset.options !== text) {
    list.dataset.options = text;
    fill(list, wanted.map(([value, words]) => element("option", { value }, words)));
  }
  list.value = chosen;
}
