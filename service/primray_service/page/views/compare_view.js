// Two pictures on top of each other: a slider between them (a wipe), one after the other (a flicker), or their difference, at one
// exposure, with the values of both under the cursor. The difference and its measures are computed here, from the half floats.

import { get, jobPath } from "../base/api.js";
import { button, choice, element, field, fill, write } from "../base/dom.js";
import * as format from "../base/format.js";
import { problemBox } from "../base/problem_box.js";
import { TERMINAL } from "../base/words.js";
import { compareSide } from "../picture/compare_side.js";
import { divider } from "../picture/divider.js";
import { compared, drawDifference } from "../picture/raw_image.js";
import { stage } from "../picture/stage.js";
import { nameOf } from "./jobs_view.js";

const MODES = [["split", "Slider"], ["flicker", "Flicker"], ["a", "A"], ["b", "B"], ["difference", "Difference"]];
const FLICKER_S = 0.7; // each of the two is seen: no faster than people may safely be shown changes (WCAG 2.3.1: 3 flashes a second)
const LOOKS = [["display", "As the PNG"], ["srgb", "Plain sRGB"]];
const OFFERED = 100; // jobs in each list
const LOOK_EVERY_S = 3; // while one of the two goes on
const EXPOSE_AFTER_S = 0.06;
const KEY_STOPS = 0.5;

export function compareView(root, [first, second]) {
  const trouble = element("div", {});
  const pickers = element("div", { class: "bar" });
  const values = element("output", { class: "values two", "aria-label": "Values of the pixel under the cursor" });
  const keys = { words: "A and B show one of them, Space the other, W wipes, F flickers, D shows the difference, E and Shift E expose", press: onKey };
  const board = stage("The two pictures", { onPixel: tellPixel, keys });
  const [a, b] = [compareSide(first), compareSide(second)];
  const canvas = element("canvas", {});
  const tags = [element("span", { class: "tag left" }, "A"), element("span", { class: "tag right" }, "B")];
  const line = divider(board, place);
  board.sheet.prepend(a.layer, b.layer, canvas);
  board.root.append(line.root, ...tags);
  const split = element("input", { type: "range", min: "0", max: "100", step: "0.5", value: "50", on: { input: arrange } });
  const exposure = element("input", { type: "range", min: "-8", max: "8", step: "0.25", value: "0", on: { input: expose } });
  const gain = element("input", { type: "range", min: "0", max: "8", step: "0.5", value: "3", on: { input: expose } });
  const look = choice(LOOKS, "display", { on: { change: draw } });
  const frame = element("input", { type: "number", min: "1", value: "1", step: "1", on: { change: () => load() } });
  const [stops, times] = [element("output", { class: "stops" }, "0"), element("output", { class: "stops" }, "× 8")];
  const mode = element("div", { class: "segments", role: "group", "aria-label": "Show" }, MODES.map(([name, text]) => button(text, () => choose(name), { data: { mode: name } })));
  const numbers = element("dl", { class: "numbers-list" });
  const [splitField, lookField, frameField] = [field("Between A and B", split), field("Look", look), field("Frame, by place", frame)];
  const gainField = element("div", { class: "field exposure" }, element("label", { for: (gain.id = "gain") }, "Difference times"), gain, times);
  const exposureField = element("div", { class: "field exposure" }, element("label", { for: (exposure.id = "compare-exposure") }, "Exposure, stops"), exposure, stops);
  const picture = element(
    "section",
    { class: "viewer", hidden: true, "aria-label": "The two pictures" },
    board.root,
    element("div", { class: "under" }, values),
    element("div", { class: "bar" }, mode, splitField, gainField, exposureField, lookField, frameField, board.tools),
    numbers,
  );
  frameField.hidden = true;
  let shown = "split";
  let [closed, timer, exposeTimer, flickerTimer] = [false, 0, 0, 0];
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
    const name = { a: "a", b: "b", w: "split", f: "flicker", d: "difference" }[key];
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
    if (items.length < 2) fill(trouble, element("p", { class: "note" }, "There are not two jobs to compare yet."));
  }

  // The address says what is compared, so that it can be kept and sent to others.
  function go(one, two) {
    location.hash = `#/compare/${encodeURIComponent(one || "-")}${two ? `/${encodeURIComponent(two)}` : ""}`;
  }

  async function load() {
    clearTimeout(timer);
    if (!a.id || !b.id) {
      fill(trouble, element("p", { class: "note" }, "Choose two jobs."));
      return;
    }
    try {
      const number = Math.round(Number(frame.value)) || 1;
      const changed = await Promise.all([a.load(number), b.load(number)]);
      if (closed) return;
      const most = Math.max(...[a, b].map(({ job }) => job.progress?.frames?.total ?? 1));
      frameField.hidden = most < 2;
      frame.max = String(most);
      fill(trouble, notes());
      if (changed.some(Boolean)) {
        if (sameSize()) tellNumbers(compared(a.raw, b.raw));
        else fill(numbers);
        await draw();
      }
      if ([a, b].some(({ job }) => !TERMINAL.has(job.state))) timer = setTimeout(load, 1000 * LOOK_EVERY_S);
    } catch (failure) {
      if (closed) return;
      fill(trouble, problemBox(failure.problem ?? { title: "The two cannot be compared", detail: failure.message }, { retry: load }));
    }
  }

  function notes() {
    const going = [a, b].some(({ job }) => !TERMINAL.has(job.state));
    return [
      !sameSize() && element("p", { class: "note" }, `The sizes differ (${size(a.raw)} and ${size(b.raw)}): B is fitted into A’s size in its own shape, and there is no difference to compute.`),
      going && element("p", { class: "note" }, "At least one of the two is not finished: what is shown follows it."),
    ];
  }

  const size = (raw) => `${raw.fullWidth} × ${raw.fullHeight}`;
  const sameSize = () => a.raw.width === b.raw.width && a.raw.height === b.raw.height && a.raw.fullWidth === b.raw.fullWidth;

  async function draw() {
    if (!a.raw || !b.raw) return;
    const value = Number(exposure.value);
    picture.hidden = false;
    board.size(a.raw.width, a.raw.height);
    if (sameSize()) drawDifference(canvas, a.raw, b.raw, value, 2 ** Number(gain.value));
    arrange();
    try {
      await Promise.all([a.show(look.value, value), b.show(look.value, value)]);
    } catch (failure) {
      if (!failure.problem || closed) return;
      fill(trouble, problemBox(failure.problem, { retry: draw }));
    }
  }

  function tellNumbers({ rmse, relmse, largest, at, equal }) {
    const pairs = equal
      ? [["Difference", "none: every value is the same"]]
      : [["Root of the mean square", format.error(rmse)], ["relMSE of A against B", format.error(relmse)], ["Largest", `${format.error(largest)} at ${at.join(", ")}`]];
    fill(numbers, pairs.map(([name, text]) => element("div", {}, element("dt", {}, name), element("dd", {}, text))));
  }

  function arrange() {
    if (shown === "difference" && a.raw && !sameSize()) shown = "split";
    const now = shown === "flicker" ? (isB ? "b" : "a") : shown;
    for (const tool of mode.children) tool.setAttribute("aria-pressed", String(tool.dataset.mode === shown));
    splitField.hidden = shown !== "split";
    gainField.hidden = shown !== "difference";
    lookField.hidden = shown === "difference";
    tags[0].hidden = a.layer.hidden = !["split", "a"].includes(now);
    tags[1].hidden = b.layer.hidden = !["split", "b"].includes(now);
    canvas.hidden = shown !== "difference";
    b.layer.style.clipPath = shown === "split" ? `inset(0 0 0 ${split.value}%)` : "";
    split.setAttribute("aria-valuetext", `A to ${split.value} %, B after`);
    picture.dataset.shown = shown;
    line.show(shown === "split" && a.raw !== null, Number(split.value));
  }

  function tellPixel(at) {
    if (!at || !a.raw || !b.raw) {
      write(values, "");
      return "";
    }
    const words = a.raw.words(...at);
    const other = sameSize() ? b.raw.words(...at) : "";
    fill(values, element("span", {}, `x ${at[0]}, y ${at[1]}`), element("span", { class: "numbers" }, `A ${words}`), element("span", { class: "numbers" }, other && `B ${other}`));
    return `Pixel ${at[0]}, ${at[1]}: A ${words}, B ${other}`;
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
