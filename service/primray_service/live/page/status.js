// What the viewer is doing, in words with the share that is done, and the figures of the picture that is shown.

import { element, write } from "../page/base/dom.js";

const PHASES = {
  opening: "Opening",
  drafting: "Drafting",
  preparing: "Preparing",
  rendering: "Refining",
  finished: "Finished",
  failed: "Failed",
};
const STEPS = {
  translate: "translating the stage",
  textures: "reading textures",
  dice: "dicing surfaces",
  build: "building the scene",
};

export function status() {
  const phase = element("span", { class: "phase" });
  const share = element("progress", { max: 1, hidden: true, "aria-label": "Share of the preparation that is done" });
  const numbers = element("span", {});
  const error = element("span", {});
  const speed = element("span", { id: "speed" });
  const root = element("p", { class: "numbers-line", id: "numbers" }, phase, share, numbers, error, speed);

  function show(state) {
    write(phase, wordsOf(state));
    share.hidden = !state.doing;
    if (state.doing) share.value = shareOf(state.doing);
    if (!(state.picture > 0)) return;
    const [width, height] = state.size;
    write(numbers, `${width} × ${height}, ${Number(state.samples.toFixed(1))} samples a pixel, ${state.seconds} s`);
    write(error, state.relmse ? `error (relMSE) ${brief(state.relmse[0])}, 95 %: ${brief(state.relmse[1])} to ${brief(state.relmse[2])}` : "error not known yet");
  }

  // Shows how long a step took from the hand to the eye.
  function step(seconds) {
    write(speed, `${seconds.toFixed(2)} s a step, ${(1 / Math.max(seconds, 1e-3)).toFixed(0)} a second`);
  }

  return { root, show, step };
}

function wordsOf({ phase, doing }) {
  const name = PHASES[phase] ?? phase;
  if (!doing) return name;
  const count = doing.all > 0 ? `, ${doing.done} of ${doing.all}` : "";
  return `${name}: ${STEPS[doing.step] ?? doing.step}${count}`;
}

const shareOf = ({ number, of, done, all }) => (number - 1 + (all > 0 ? done / all : 0)) / of;

const brief = (number) => (Number.isFinite(number) ? number.toPrecision(2) : "?");
