// A region of the picture, marked on a stage: by dragging a rectangle over it, or with fields in per cent.

import { button, element, write } from "../base/dom.js";

const SIDES = ["Left", "Top", "Right", "Bottom"];
const LEAST = 4; // pixels a side

// `onRender(region)` is called with left, bottom, right, top from 0 to 1 of the whole frame, from the bottom, as in
// dataWindowNDC.
export function region(board, onRender) {
  const frame = element("div", { class: "region", hidden: true });
  const toggle = button("Region…", () => (toggle.getAttribute("aria-expanded") === "true" ? end() : begin()), { "aria-expanded": "false" });
  const fields = SIDES.map((name) => element("input", { type: "number", min: "0", max: "100", step: "0.1", "aria-label": `${name}, per cent`, on: { input: typed } }));
  const render = button("Render this region", () => onRender(ndc()), { class: "main" });
  const words = element("span", { class: "soft" });
  const panel = element("div", { class: "region-panel", hidden: true }, element("span", { class: "soft" }, "Drag over the picture, or in per cent:"), SIDES.map((name, at) => element("span", { class: "side" }, element("span", { "aria-hidden": "true" }, name), fields[at])), render, words);
  let box = [0.25, 0.25, 0.75, 0.75]; // left, top, right, bottom of the sheet
  let [from, size] = [null, [1, 1]];
  board.sheet.append(frame);

  function begin() {
    toggle.setAttribute("aria-expanded", "true");
    panel.hidden = frame.hidden = false;
    board.root.classList.add("marking");
    show();
  }

  function end() {
    toggle.setAttribute("aria-expanded", "false");
    panel.hidden = frame.hidden = true;
    board.root.classList.remove("marking");
  }

  function show() {
    const [left, top, right, bottom] = box.map((side) => 100 * side);
    Object.assign(frame.style, { left: `${left}%`, top: `${top}%`, width: `${right - left}%`, height: `${bottom - top}%` });
    fields.forEach((input, at) => {
      if (input !== document.activeElement) input.value = (100 * box[at]).toFixed(1);
    });
    const [width, height] = [(box[2] - box[0]) * size[0], (box[3] - box[1]) * size[1]].map(Math.round);
    render.disabled = !(width >= LEAST && height >= LEAST);
    write(words, `${width} × ${height} pixels`);
  }

  function typed() {
    const typed = fields.map((input) => Math.min(100, Math.max(0, Number(input.value))) / 100);
    if (typed.every(Number.isFinite)) box = typed;
    show();
  }

  const place = (event) => {
    const sheet = board.sheet.getBoundingClientRect();
    return [(event.clientX - sheet.left) / sheet.width, (event.clientY - sheet.top) / sheet.height].map((at) => Math.min(1, Math.max(0, at)));
  };

  // Handles the event before the stage, whose drags move the picture.
  board.root.addEventListener("pointerdown", (event) => {
    if (panel.hidden || event.button !== 0) return;
    event.stopImmediatePropagation();
    board.root.setPointerCapture(event.pointerId);
    from = place(event);
  }, { capture: true });
  board.root.addEventListener("pointermove", (event) => {
    if (!from) return;
    const [x, y] = place(event);
    box = [Math.min(from[0], x), Math.min(from[1], y), Math.max(from[0], x), Math.max(from[1], y)];
    show();
  });
  for (const name of ["pointerup", "pointercancel"]) board.root.addEventListener(name, () => (from = null));

  const ndc = () => [box[0], 1 - box[3], box[2], 1 - box[1]].map((side) => Number(side.toFixed(5)));

  return {
    toggle,
    panel,
    // Sets the size of the whole picture, in pixels.
    size: (width, height) => {
      size = [width, height];
      show();
    },
  };
}
