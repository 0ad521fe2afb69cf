// Two pictures on top of each other: a slider between them, or their difference, at one exposure, with the values of both
// under the cursor. Everything is computed here from the half-float previews.

import { call, get, jobPath } from "./api.js";
import { button, choice, element, field, fill, write } from "./dom.js";
import * as format from "./format.js";
import { nameOf } from "./jobs_view.js";
import { problemBox } from "./problem_view.js";
import { compared, decodeRaw, drawDifference, drawPicture } from "./raw_image.js";
import { stage } from "./stage.js";
import { TERMINAL } from "./words.js";

const MODES = [["split", "Slider"], ["a", "A"], ["b", "B"], ["difference", "Difference"]];
const OFFERED = 100; // jobs in each list
const LOOK_EVERY_S = 3; // while one of the two goes on

export function compareView(root, [first, second]) {
  const trouble = element("div", {});
  const pickers = element("div", { class: "bar" });
  const values = element("output", { class: "values two", "aria-label": "Values of the pixel under the cursor" });
  const board = stage("The two pictures", { onPixel: tellPixel });
  const canvases = { a: element("canvas", {}), b: element("canvas", {}), difference: element("canvas", {}) };
  const divider = element("div", { class: "divider", hidden: true });
  const tags = [element("span", { class: "tag left" }, "A"), element("span", { class: "tag right" }, "B")];
  board.sheet.prepend(canvases.a, canvases.b, canvases.difference);
  board.root.append(divider, ...tags);
  const place = element("input", { type: "range", min: "0", max: "100", step: "0.5", value: "50", on: { input: show } });
  const exposure = element("input", { type: "range", min: "-8", max: "8", step: "0.25", value: "0", on: { input: redraw } });
  const gain = element("input", { type: "range", min: "0", max: "8", step: "0.5", value: "3", on: { input: redraw } });
  const stops = element("output", { class: "stops" });
  const times = element("output", { class: "stops" });
  const mode = element("div", { class: "segments", role: "group", "aria-label": "Show" }, MODES.map(([name, text]) => button(text, () => choose(name), { data: { mode: name } })));
  const numbers = element("dl", { class: "numbers-list" });
  const placeField = field("Between A and B", place);
  const gainField = element("div", { class: "field exposure" }, element("label", { for: (gain.id = "gain") }, "Difference times"), gain, times);
  const exposureField = element("div", { class: "field exposure" }, element("label", { for: (exposure.id = "compare-exposure") }, "Exposure"), exposure, stops);
  const picture = element("section", { class: "viewer", hidden: true }, board.root, element("div", { class: "under" }, values), element("div", { class: "bar" }, mode, frameField, placeField, gainField, exposureField, board.tools), numbers);
  const frame = element("input", { type: "number", min: "1", value: "1", step: "1", on: { change: () => load() } });
  const frameField = field("Frame, by place", frame);
  frameField.hidden = true;
  const sides = { a: { id: first, raw: null }, b: { id: second, raw: null } };
  let shown = "split";
  let pixel = null;
  let [closed, timer] = [false, 0];
  fill(root, element("h1", {}, "Compare"), pickers, trouble, picture);

  function choose(name) {
    shown = name;
    show();
  }

  async function start() {
    try {
      const { items } = await get(`/v1/jobs?limit=${OFFERED}`);
      for (const side of [sides.a, sides.b]) {
        if (side.id && !items.some(({ id }) => id === side.id)) items.unshift(await get(jobPath(side.id)));
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
    const list = (name, side) => field(name, choice(options, side.id ?? "", { on: { change: (event) => go(side, event.target.value) } }));
    const swap = button("Swap", () => go(sides.a, sides.b.id ?? "", sides.a.id ?? ""));
    fill(pickers, list("A", sides.a), list("B", sides.b), swap);
    if (items.length < 2) fill(trouble, element("p", { class: "note" }, "There are not two jobs to compare yet."));
  }

  // The address says what is compared, so that it can be kept and sent to others.
  function go(side, id, other) {
    const a = side === sides.a ? id : (sides.a.id ?? "");
    const b = side === sides.b ? id : (other ?? sides.b.id ?? "");
    location.hash = a && b ? `#/compare/${encodeURIComponent(a)}/${encodeURIComponent(b)}` : `#/compare/${encodeURIComponent(a || b)}`;
  }

  async function load() {
    clearTimeout(timer);
    if (!sides.a.id || !sides.b.id) {
      fill(trouble, element("p", { class: "note" }, "Choose two jobs."));
      return;
    }
    try {
      const changed = await Promise.all([sides.a, sides.b].map(fetchSide));
      if (closed) return;
      const most = Math.max(...[sides.a, sides.b].map(({ job }) => job.progress?.frames?.total ?? 1));
      frameField.hidden = most < 2;
      frame.max = String(most);
      fill(trouble, notes());
      if (changed.some(Boolean)) redraw();
      if ([sides.a, sides.b].some(({ job }) => !TERMINAL.has(job.state))) timer = setTimeout(load, 1000 * LOOK_EVERY_S);
    } catch (failure) {
      if (!failure.problem || closed) return;
      fill(trouble, problemBox(failure.problem, { retry: load }));
    }
  }

  async function fetchSide(side) {
    side.job = await get(jobPath(side.id));
    const total = side.job.progress?.frames?.total ?? 1;
    const number = Math.min(total, Math.max(1, Math.round(Number(frame.value)) || 1)) - 1;
    const response = await call("GET", jobPath(side.id, `/preview?format=raw&frame=${number}`), { accept: "*/*" });
    const tag = `${number} ${response.headers.get("etag")}`;
    if (tag === side.tag) return false;
    side.raw = decodeRaw(await response.arrayBuffer());
    side.tag = tag;
    return true;
  }

  function notes() {
    const going = [sides.a, sides.b].some(({ job }) => !TERMINAL.has(job.state));
    return [
      !sameSize() && element("p", { class: "note" }, `The sizes differ (${size(sides.a.raw)} and ${size(sides.b.raw)}): B is shown at A’s size, and there is no difference to compute.`),
      going && element("p", { class: "note" }, "At least one of the two is not finished: what is shown follows it."),
    ];
  }

  const size = (raw) => `${raw.width} × ${raw.height}`;
  const sameSize = () => sides.a.raw.width === sides.b.raw.width && sides.a.raw.height === sides.b.raw.height;

  function redraw() {
    const value = Number(exposure.value);
    write(stops, `${value > 0 ? "+" : ""}${value}`);
    exposure.setAttribute("aria-valuetext", `${value} stops`);
    const factor = 2 ** Number(gain.value);
    write(times, `× ${format.error(factor)}`);
    gain.setAttribute("aria-valuetext", `${factor} times`);
    if (!sides.a.raw || !sides.b.raw) return;
    picture.hidden = false;
    board.size(sides.a.raw.width, sides.a.raw.height);
    drawPicture(canvases.a, sides.a.raw, value);
    drawPicture(canvases.b, sides.b.raw, value);
    for (const canvas of Object.values(canvases)) {
      canvas.style.width = `${sides.a.raw.width}px`;
      canvas.style.height = `${sides.a.raw.height}px`;
    }
    if (sameSize()) {
      drawDifference(canvases.difference, sides.a.raw, sides.b.raw, value, factor);
      tellNumbers(compared(sides.a.raw, sides.b.raw));
    } else fill(numbers);
    show();
  }

  function tellNumbers({ rmse, relmse, largest, at, equal }) {
    const pairs = equal
      ? [["Difference", "none: every value is the same"]]
      : [["Root of the mean square", format.error(rmse)], ["relMSE of A against B", format.error(relmse)], ["Largest", `${format.error(largest)} at ${at.join(", ")}`]];
    fill(numbers, pairs.map(([name, value]) => element("div", {}, element("dt", {}, name), element("dd", {}, value))));
  }

  function show() {
    if (shown === "difference" && sides.a.raw && !sameSize()) shown = "split";
    for (const tool of mode.children) tool.setAttribute("aria-pressed", String(tool.dataset.mode === shown));
    placeField.hidden = shown !== "split";
    gainField.hidden = shown !== "difference";
    tags[0].hidden = !["split", "a"].includes(shown);
    tags[1].hidden = !["split", "b"].includes(shown);
    canvases.a.hidden = !["split", "a"].includes(shown);
    canvases.b.hidden = !["split", "b"].includes(shown);
    canvases.difference.hidden = shown !== "difference";
    canvases.b.style.clipPath = shown === "split" ? `inset(0 0 0 ${place.value}%)` : "";
    place.setAttribute("aria-valuetext", `A to ${place.value} %, B after`);
    picture.dataset.shown = shown;
    follow();
  }

  // The divider lies on the stage, not on the sheet: it stays one pixel wide at every zoom.
  function follow() {
    divider.hidden = shown !== "split" || !sides.a.raw;
    if (divider.hidden) return;
    const sheet = board.sheet.getBoundingClientRect();
    divider.style.left = `${sheet.left - board.root.getBoundingClientRect().left + (sheet.width * Number(place.value)) / 100}px`;
  }
  const moved = new MutationObserver(follow);
  moved.observe(board.sheet, { attributeFilter: ["style"] });
  const dragged = (event) => {
    if (event.buttons !== 1 && event.type !== "pointerdown") return;
    const sheet = board.sheet.getBoundingClientRect();
    place.value = String((100 * (event.clientX - sheet.left)) / sheet.width);
    show();
  };
  divider.addEventListener("pointerdown", (event) => {
    divider.setPointerCapture(event.pointerId);
    event.stopPropagation();
    dragged(event);
  });
  divider.addEventListener("pointermove", (event) => {
    event.stopPropagation();
    dragged(event);
  });

  function tellPixel(at) {
    pixel = at;
    if (!at || !sides.a.raw || !sides.b.raw) {
      write(values, "");
      return "";
    }
    const words = sides.a.raw.words(...at);
    const other = sameSize() ? sides.b.raw.words(...pixel) : "";
    fill(values, element("span", {}, `x ${at[0]}, y ${at[1]}`), element("span", { class: "numbers" }, `A ${words}`), element("span", { class: "numbers" }, other && `B ${other}`));
    return `Pixel ${at[0]}, ${at[1]}: A ${words}, B ${other}`;
  }

  start();
  return () => {
    closed = true;
    clearTimeout(timer);
    moved.disconnect();
    board.close();
  };
}
