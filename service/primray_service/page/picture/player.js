// Plays the frames of a sequence over the picture, at the stage's rate: each is fetched once, at a size that a page can hold.

import { button, element, say, write } from "../base/dom.js";
import { drop, fetchPicture } from "./picture.js";

const MOST_FRAMES = 600;
const WIDTH = 960; // of a frame, at most
const AT_ONCE = 4; // requests

// `onFrame(number)` is called with the visible frame when it is stopped; `query()` returns the settings of the view.
export function player(job, sheet, { query, onFrame }) {
  const layer = element("div", { class: "layer playing", hidden: true });
  const play = button("Play", () => (isOn ? stop() : start()), { "aria-pressed": "false", hidden: true });
  const words = element("span", { class: "soft", role: "status" });
  const root = element("span", { class: "player" }, play, words);
  let frames = []; // their numbers, in order
  let fps = 24;
  let images = [];
  let [isOn, closed, request, run] = [false, false, 0, 0];
  sheet.append(layer);

  // Sets the finished frames, and their number in a second.
  function know(numbers, rate) {
    frames = numbers.slice(0, MOST_FRAMES);
    fps = rate > 0 ? rate : 24;
    play.hidden = frames.length < 2;
    play.title = `Play ${frames.length} frames, ${fps} a second`;
    if (play.hidden && isOn) stop();
  }

  async function start() {
    const mine = ++run;
    isOn = true;
    write(play, "Stop");
    play.setAttribute("aria-pressed", "true");
    const wanted = [...frames];
    images = new Array(wanted.length).fill(null);
    let [next, done] = [0, 0];
    const load = async () => {
      while (next < wanted.length && mine === run) {
        const at = next++;
        const { image } = await fetchPicture(job, { ...query(), frame: wanted[at], width: WIDTH });
        if (mine !== run || closed) return drop(image);
        images[at] = image;
        write(words, `Loading: ${++done} of ${wanted.length}`);
      }
      return undefined;
    };
    try {
      await Promise.all(Array.from({ length: AT_ONCE }, load));
    } catch (failure) {
      if (mine !== run) return;
      stop();
      write(words, failure.problem?.detail ?? "The frames cannot be played.");
      return;
    }
    if (mine !== run || closed) return;
    write(words, "");
    say(`Playing ${wanted.length} frames, ${fps} a second`);
    layer.hidden = false;
    const began = performance.now();
    let shown = -1;
    const show = (now) => {
      if (mine !== run) return;
      const at = Math.floor((Math.max(0, now - began) * fps) / 1000) % wanted.length;
      if (at !== shown && images[at]) {
        layer.replaceChildren(images[at]);
        layer.dataset.frame = String(wanted[at]);
        shown = at;
      }
      request = requestAnimationFrame(show);
    };
    request = requestAnimationFrame(show);
  }

  function stop() {
    run += 1;
    cancelAnimationFrame(request);
    isOn = false;
    write(play, "Play");
    write(words, "");
    play.setAttribute("aria-pressed", "false");
    const frame = layer.dataset.frame;
    layer.hidden = true;
    images.forEach(drop);
    images = [];
    if (frame !== undefined && !closed) onFrame(Number(frame));
    delete layer.dataset.frame;
  }

  return {
    root,
    know,
    stop: () => isOn && stop(),
    close: () => {
      closed = true;
      if (isOn) stop();
    },
  };
}
