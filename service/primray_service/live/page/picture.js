// The picture: pictures come as bytes, are drawn one after the other, the newest first of those that wait.

import { element, say } from "../page/base/dom.js";
import { pointIn } from "../page/live/navigate.js";
import { seen } from "./server.js";

const LABEL =
  "The picture. Arrow keys turn it, with Shift they move it; + and - bring it nearer and farther; W, A, S, D, Q and E fly.";

// `onStep` is called with the seconds from an action to the picture that shows it.
export function picture(onStep) {
  const canvas = element("canvas", { width: 1, height: 1 });
  const root = element("div", { class: "stage looked-at", tabindex: 0, role: "img", "aria-label": LABEL, data: { pictures: 0 } }, canvas);
  const context = canvas.getContext("2d", { willReadFrequently: true }); // the GPU is not used
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
    const step = seen(answer.headers.get("x-token"));
    if (step !== null) onStep(step);
  }

  return { root, show, pointOf: (event) => pointIn(canvas, event) };
}
