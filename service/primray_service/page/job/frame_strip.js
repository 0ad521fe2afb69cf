// The frames of a job that has several: a button each, with its state and error. The strip follows the frame that is being
// rendered until another is chosen.

import { get, jobPath } from "../base/api.js";
import { button, element, fill, write } from "../base/dom.js";
import * as format from "../base/format.js";
import { stateWords } from "../base/words.js";

const SHOWN = 200;

const ENDED = new Set(["succeeded", "failed", "canceled"]);

// `onFrames(frames)` is called with the frames that are shown, whenever they are read.
export function frameStrip(job, onChoose, onRetry, onFrames = () => {}) {
  const list = element("div", { class: "frames", role: "group", "aria-label": "Frames" });
  const pages = element("div", { class: "pages" });
  const follow = button("Follow", () => choose(null), { "aria-pressed": "true", class: "quiet", title: "Show the frame that is being rendered" });
  const retry = button("Render again", () => chosen !== null && onRetry(chosen), { class: "quiet", hidden: true });
  const root = element("section", { class: "strip", hidden: true }, element("div", { class: "strip-head" }, element("h2", {}, "Frames"), follow, retry, pages), list);
  const chips = new Map();
  let [frames, first, chosen] = [[], 0, null];
  let total = 0;

  function choose(number) {
    chosen = number;
    follow.setAttribute("aria-pressed", String(number === null));
    update();
  }

  async function load(count) {
    total = count;
    root.hidden = false;
    const after = first > 0 ? `&after=${first - 1}` : "";
    frames = (await get(jobPath(job, `/frames?limit=${SHOWN}${after}`))).items;
    update();
    onFrames(frames);
  }

  function update() {
    const running = frames.find((frame) => frame.state === "running");
    const ended = frames.filter((frame) => frame.state === "succeeded").at(-1);
    const now = chosen ?? running?.number ?? ended?.number ?? first;
    const numbers = new Set(frames.map((frame) => frame.number));
    for (const [number, chip] of chips) {
      if (!numbers.has(number)) {
        chip.remove();
        chips.delete(number);
      }
    }
    for (const frame of frames) draw(frame, now);
    const one = frames.find((frame) => frame.number === chosen);
    retry.hidden = !ENDED.has(one?.state);
    if (one) write(retry, `Render frame ${one.time_code ?? one.number} again`);
    fill(
      pages,
      first > 0 && button(`Earlier`, () => page(-SHOWN), { class: "quiet" }),
      total > SHOWN && element("span", {}, `${first + 1}–${Math.min(first + SHOWN, total)} of ${total}`),
      first + SHOWN < total && button(`Later`, () => page(SHOWN), { class: "quiet" }),
    );
    onChoose(now, frames.find((frame) => frame.number === now));
  }

  function page(by) {
    first = Math.max(0, first + by);
    load(total);
  }

  function draw(frame, now) {
    let chip = chips.get(frame.number);
    if (!chip) {
      chip = element("button", { type: "button", class: "chip", on: { click: () => choose(frame.number) } }, element("b"), element("small"), element("i"));
      chips.set(frame.number, chip);
      list.append(chip);
    }
    const name = frame.time_code ?? frame.number;
    const estimate = frame.progress?.error?.estimate;
    write(chip.children[0], name);
    write(chip.children[1], frame.state === "queued" ? "waiting" : estimate ? format.error(estimate) : stateWords(frame.state));
    const fraction = frame.state === "succeeded" ? 1 : (frame.progress?.fraction ?? 0);
    chip.children[2].style.width = `${100 * fraction}%`;
    chip.dataset.state = frame.state;
    chip.setAttribute("aria-pressed", String(frame.number === now));
    chip.setAttribute("aria-label", `Frame ${name}: ${stateWords(frame.state)}`);
  }

  return { root, load, choose };
}
