// What the viewer is doing, and the figures of the picture that is shown.

import { element, write } from "../page/base/dom.js";
import { errorWords, phaseWords, shareOf, sizeWords, stepWords } from "../page/live/figures.js";

export function status() {
  const phase = element("span", { class: "phase" });
  const share = element("progress", { max: 1, hidden: true, "aria-label": "Share of the preparation that is done" });
  const numbers = element("span", {});
  const error = element("span", {});
  const speed = element("span", { id: "speed" });
  const root = element("p", { class: "numbers-line", id: "numbers" }, phase, share, numbers, error, speed);

  function show(state) {
    write(phase, phaseWords(state));
    share.hidden = !state.doing;
    if (state.doing) share.value = shareOf(state.doing);
    if (!(state.picture > 0)) return;
    write(numbers, sizeWords(state));
    write(error, errorWords(state));
  }

  // Shows how long a step took from the hand to the eye.
  function step(seconds) {
    write(speed, stepWords(seconds));
  }

  return { root, show, step };
}
