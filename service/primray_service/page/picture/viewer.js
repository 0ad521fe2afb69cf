// A job's picture as it refines: the next preview is fetched and decoded behind the one that is shown, then they swap.
// Exposure, channel and view are the server's work; the values under the cursor come from the half-float preview, fetched
// when somebody points at one.

import { call, jobPath } from "../base/api.js";
import { button, choice, element, field, fill, write } from "../base/dom.js";
import { legend } from "./legend.js";
import { drop, fetchPicture } from "./picture.js";
import { decodeRaw } from "./raw_image.js";
import { stage } from "./stage.js";

const VIEWS = [
  ["beauty", "Picture"],
  ["error", "Error"],
  ["relative-error", "Error, relative"],
];
const CHANNELS = [
  ["rgb", "Colour"],
  ["r", "Red"],
  ["g", "Green"],
  ["b", "Blue"],
  ["a", "Alpha"],
  ["luminance", "Luminance"],
];
const AGAIN_S = 0.15; // after there was no picture where one was expected
const ASK_S = 4; // a worker writes pictures only while somebody asks; it forgets after 10 s
const RAW_AGE_S = 2; // of values under the cursor while the picture refines
const EXPOSE_AFTER_S = 0.06; // a slider that is dragged asks for the last place only

export function viewer(job, { onFirst = () => {} } = {}) {
  const values = element("output", { class: "values", "aria-label": "Values of the pixel under the cursor" });
  const waiting = element("span", {}, "Waiting for the first picture");
  const pulse = element("span", { class: "pulse" });
  const wait = element("p", { class: "wait" }, pulse, waiting);
  const board = stage("The picture", { onPixel: tellPixel });
  board.root.append(wait);
  let state = { frame: null, view: "beauty", channel: "rgb", exposure: 0 };
  let front = null; // the <img> that is seen
  let [isThere, isLive, isWanted, isLoading, closed] = [false, true, false, false, false];
  let [tag, shownAs] = ["", ""];
  let [timer, exposeTimer] = [0, 0];
  let raw = null; // {frame, at, image, pending}
  let pixel = null;

  const view = choice(VIEWS, "beauty", { on: { change: () => set({ view: view.value }) } });
  const channel = choice(CHANNELS, "rgb", { on: { change: () => set({ channel: channel.value }) } });
  const exposure = element("input", { type: "range", min: "-8", max: "8", step: "0.25", value: "0", on: { input: expose } });
  const stops = element("output", { class: "stops" }, "0");
  const reset = button("Reset", () => {
    exposure.value = "0";
    expose();
    exposure.focus();
  }, { class: "quiet", hidden: true, "aria-label": "Reset exposure" });
  const note = element("p", { class: "note", role: "status" });
  const colors = legend();
  const exposureField = element("div", { class: "field exposure" }, element("label", { for: (exposure.id = "exposure") }, "Exposure, stops"), exposure, stops, reset);
  const bar = element("div", { class: "bar" }, field("View", view), field("Channel", channel), exposureField, board.tools);
  const root = element("div", { class: "viewer" }, board.root, element("div", { class: "under" }, values, colors.root), bar, note);

  function expose() {
    const value = Number(exposure.value);
    write(stops, `${value > 0 ? "+" : ""}${value}`);
    exposure.setAttribute("aria-valuetext", `${value} stops`);
    reset.hidden = value === 0;
    clearTimeout(exposeTimer);
    exposeTimer = setTimeout(() => set({ exposure: value }), 1000 * EXPOSE_AFTER_S);
  }

  function set(changes) {
    const before = sourceOf(state);
    state = { ...state, ...changes };
    if (sourceOf(state) !== before) ask();
  }

  const sourceOf = (now) => JSON.stringify(now);

  function ask() {
    isWanted = true;
    if (isThere && !isLoading && !closed) load();
  }

  async function load() {
    clearTimeout(timer);
    [isWanted, isLoading] = [false, true];
    const source = sourceOf(state);
    let pause = ASK_S;
    try {
      const found = await fetchPicture(job, state, tag);
      if (found.image) swap(found.image);
      [tag, shownAs] = [found.tag, source];
      colors.show(found.scale);
      write(note, "");
    } catch (failure) {
      if (!failure.problem) throw failure;
      if (!front) pause = Math.max(AGAIN_S, failure.retryAfter ?? 0);
      if (failure.problem.status === 422) write(note, failure.problem.detail);
      else if (shownAs && shownAs !== source && failure.problem.status !== 0) write(note, failure.problem.detail);
    } finally {
      isLoading = false;
    }
    if (closed) return;
    if (isWanted) ask();
    else if (isLive) timer = setTimeout(() => (document.hidden ? (isWanted = true) : ask()), 1000 * pause);
  }

  // A page that is not looked at does not ask; it does at once when it is.
  const seen = () => !document.hidden && isWanted && ask();
  document.addEventListener("visibilitychange", seen);

  function swap(next) {
    if (closed) {
      drop(next);
      return;
    }
    board.size(next.naturalWidth, next.naturalHeight);
    board.sheet.prepend(next);
    const before = front;
    front = next;
    if (before) drop(before);
    else {
      wait.remove();
      onFirst();
    }
    root.dataset.pictures = String(Number(root.dataset.pictures ?? 0) + 1);
  }

  function tellPixel(at) {
    pixel = at;
    if (!at || !front) {
      write(values, "");
      return "";
    }
    if (raw?.frame !== state.frame) raw = null;
    if (!raw || (!raw.pending && isLive && Date.now() - raw.at > 1000 * RAW_AGE_S)) fetchRaw();
    const { image } = raw;
    const words = image ? image.words(...at) : "…";
    const box = image && image.fullWidth > image.width ? `mean of ${Math.ceil(image.fullWidth / image.width)}² pixels` : "";
    fill(values, element("span", {}, `x ${at[0]}, y ${at[1]}`), element("span", { class: "numbers" }, words), box && element("span", {}, box));
    return image ? `Pixel ${at[0]}, ${at[1]}: ${words}` : "";
  }

  async function fetchRaw() {
    raw = { frame: state.frame, at: Date.now(), image: raw?.image ?? null, pending: true };
    const mine = raw;
    const frame = state.frame === null ? "" : `&frame=${state.frame}`;
    try {
      const response = await call("GET", jobPath(job, `/preview?format=raw${frame}`), { accept: "*/*" });
      mine.image = decodeRaw(await response.arrayBuffer());
    } catch (failure) {
      if (!failure.problem) write(note, failure.message);
    }
    mine.pending = false;
    if (raw === mine && pixel && !closed) tellPixel(pixel);
  }

  // There is a picture now, or a newer one.
  function refresh() {
    isThere = true;
    ask();
  }

  return {
    root,
    refresh,
    frame: (number, hasPicture) => {
      if (number !== state.frame) isThere = hasPicture;
      set({ frame: number });
    },
    live: (now, hasPicture) => {
      const ended = isLive && !now;
      isLive = now;
      if (hasPicture && (ended || !isThere)) refresh();
      pulse.hidden = !now;
      write(waiting, now ? "Waiting for the first picture" : "There is no picture");
    },
    close: () => {
      closed = true;
      clearTimeout(timer);
      clearTimeout(exposeTimer);
      document.removeEventListener("visibilitychange", seen);
      drop(front);
      board.close();
    },
  };
}
