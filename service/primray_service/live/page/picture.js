// The picture, and the mouse and keys that move the camera: drags are sent as fractions of the picture's height.

import { element, say } from "../page/base/dom.js";
import { move, send } from "./server.js";

const KEY_STEP = 0.05;
const WHEEL_STEP = 0.0015; // for a pixel of a wheel
const KINDS = { 0: "tumble", 1: "pan", 2: "dolly" }; // by button

export function picture() {
  const canvas = element("canvas", { width: 1, height: 1 });
  const root = element(
    "div",
    { class: "stage looked-at", tabindex: 0, role: "img", "aria-label": "The picture. Arrow keys turn it, with Shift they move it; + and - bring it nearer and farther.", data: { pictures: 0 } },
    canvas,
  );
  const context = canvas.getContext("2d", { willReadFrequently: true }); // pictures come as bytes, so the GPU is not used
  let fetching = false;
  let newest = 0;

  async function show(number) {
    newest = Math.max(newest, number);
    if (fetching) return;
    fetching = true;
    try {
      while (Number(root.dataset.pictures) < newest) await draw();
    } catch {
      // The stream of events reports that a server is gone.
    }
    fetching = false;
  }

  async function draw() {
    const answer = await fetch("picture", { cache: "no-store" });
    if (!answer.ok) throw new Error("no picture");
    const [width, height, number] = ["x-width", "x-height", "x-picture"].map((name) => Number(answer.headers.get(name)));
    const bytes = new Uint8ClampedArray(await answer.arrayBuffer());
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    context.putImageData(new ImageData(bytes, width, height), 0, 0);
    root.style.setProperty("--aspect", `${width} / ${height}`);
    if (root.dataset.pictures === "0") say("The first picture is there.");
    root.dataset.pictures = number;
  }

  let drag = null;

  root.addEventListener("pointerdown", (event) => {
    const kind = event.shiftKey && event.button === 0 ? "pan" : KINDS[event.button];
    if (!kind) return;
    event.preventDefault();
    root.focus({ preventScroll: true });
    root.setPointerCapture(event.pointerId);
    drag = { kind, x: event.clientX, y: event.clientY };
  });
  root.addEventListener("pointermove", (event) => {
    if (!drag) return;
    const height = root.clientHeight || 1;
    const across = (event.clientX - drag.x) / height;
    const down = (event.clientY - drag.y) / height;
    Object.assign(drag, { x: event.clientX, y: event.clientY });
    if (across === 0 && down === 0) return;
    if (drag.kind === "dolly") move("dolly", { steps: 2 * (across - down) });
    else move(drag.kind, { across, down });
  });
  for (const name of ["pointerup", "pointercancel"]) root.addEventListener(name, () => (drag = null));
  root.addEventListener("contextmenu", (event) => event.preventDefault());
  root.addEventListener("wheel", onWheel, { passive: false });
  root.addEventListener("keydown", onKey);

  function onWheel(event) {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
    move("dolly", { steps: -Math.max(-500, Math.min(500, pixels)) * WHEEL_STEP });
  }

  function onKey(event) {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const nearer = { "+": 1, "=": 1, "-": -1 }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey || !(arrows || nearer)) return;
    event.preventDefault();
    if (nearer) return move("dolly", { steps: 2 * nearer * KEY_STEP });
    return move(event.shiftKey ? "pan" : "tumble", { across: arrows[0] * KEY_STEP, down: arrows[1] * KEY_STEP });
  }

  return { root, show };
}

// These keys work wherever the focus is, except in controls for text and choices.
export function watchKeys() {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest?.("input, select, textarea")) return;
    if (event.key === "f") send({ do: "frame" });
    if (event.key === "r") send({ do: "reset" });
  });
}
