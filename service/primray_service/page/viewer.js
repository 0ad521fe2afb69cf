// A job's picture as it refines: the next preview is fetched and decoded behind the one that is shown, then they swap.
// Exposure and view are the server's work; the values under the cursor come from the half-float preview, fetched on demand.

import { call, jobPath } from "./api.js";
import { button, choice, element, field, fill, write } from "./dom.js";
import { decodeRaw } from "./raw_image.js";
import { stage } from "./stage.js";

const VIEWS = [
  ["beauty", "Picture"],
  ["error", "Error, by pixel"],
  ["albedo", "Albedo"],
  ["normal", "Normals"],
];
const FIRST_S = 0.2; // between asking for a first preview and asking again
const LATER_S = 4; // without a word from the server that there is a new one; workers stop writing when nobody looks for 10 s
const RAW_AGE_S = 2; // of values under the cursor while the picture refines

export function viewer(job, { onFirst = () => {} } = {}) {
  const values = element("output", { class: "values", "aria-label": "Values of the pixel under the cursor" });
  const wait = element("p", { class: "wait" }, element("span", { class: "pulse" }), element("span", {}, "Waiting for the first picture"));
  const board = stage("The picture", { onPixel: tellPixel });
  board.root.append(wait);
  let front = null;
  let state = { job, frame: 0, view: "beauty", exposure: 0, live: true };
  let [wanted, loading, closed] = [false, false, false];
  let tag = "";
  let shownAs = "";
  let timer = 0;
  let raw = null; // {key, at, image} or a promise of it
  let pixel = null;

  const view = choice(VIEWS, "beauty", { on: { change: () => set({ view: view.value }) } });
  const exposure = element("input", { type: "range", min: "-8", max: "8", step: "0.25", value: "0", on: { input: expose } });
  const stops = element("output", { class: "stops" }, "0");
  const reset = button("Reset", () => {
    exposure.value = "0";
    expose();
  }, { class: "quiet", hidden: true, "aria-label": "Reset exposure" });
  const note = element("p", { class: "note", role: "status" });
  const bar = element(
    "div",
    { class: "bar" },
    field("View", view),
    element("div", { class: "field exposure" }, element("label", { for: (exposure.id = "exposure") }, "Exposure"), exposure, stops, reset),
    board.tools,
  );
  const root = element("div", { class: "viewer" }, board.root, element("div", { class: "under" }, values), bar, note);

  function expose() {
    const stopsNow = Number(exposure.value);
    write(stops, `${stopsNow > 0 ? "+" : ""}${stopsNow}`);
    exposure.setAttribute("aria-valuetext", `${stopsNow} stops`);
    reset.hidden = stopsNow === 0;
    set({ exposure: stopsNow });
  }

  function set(changes) {
    const before = sourceOf(state);
    state = { ...state, ...changes };
    if (sourceOf(state) !== before) {
      raw = null;
      ask();
    }
  }

  const sourceOf = ({ frame, view, exposure }) => `frame=${frame}&view=${view}&exposure=${exposure}`;

  function ask() {
    wanted = true;
    if (!loading) load();
  }

  async function load() {
    clearTimeout(timer);
    [wanted, loading] = [false, true];
    const source = sourceOf(state);
    try {
      const response = await call("GET", jobPath(job, `/preview?${source}`), { accept: "image/png,image/jpeg" });
      const now = `${source} ${response.headers.get("etag")}`;
      if (now !== tag || !response.headers.get("etag")) await swap(await response.blob());
      tag = now;
      shownAs = source;
      write(note, "");
    } catch (failure) {
      if (!failure.problem) throw failure;
      if (shownAs && shownAs !== source && failure.problem.status === 422) write(note, failure.problem.detail);
    } finally {
      loading = false;
    }
    if (closed) return;
    if (wanted) load();
    else if (state.live) timer = setTimeout(load, 1000 * (front ? LATER_S : FIRST_S));
  }

  async function swap(blob) {
    const url = URL.createObjectURL(blob);
    const next = new Image();
    next.alt = "";
    next.draggable = false;
    next.src = url;
    try {
      await next.decode();
    } catch {
      URL.revokeObjectURL(url);
      return;
    }
    if (closed) return URL.revokeObjectURL(url);
    board.size(next.naturalWidth, next.naturalHeight);
    board.sheet.prepend(next);
    if (front) {
      URL.revokeObjectURL(front.src);
      front.remove();
    } else {
      wait.remove();
      onFirst();
    }
    front = next;
    root.dataset.pictures = String(Number(root.dataset.pictures ?? 0) + 1);
    return undefined;
  }

  function tellPixel(at) {
    pixel = at;
    if (!at || !front) {
      write(values, "");
      return "";
    }
    const key = `${state.frame} ${state.view}`;
    const fresh = raw && raw.key === key && (!state.live || Date.now() - raw.at < 1000 * RAW_AGE_S);
    if (!fresh && !raw?.pending) fetchRaw(key);
    const image = raw?.key === key ? raw.image : null;
    const words = image ? image.words(...at) : "…";
    fill(values, element("span", {}, `x ${at[0]}, y ${at[1]}`), element("span", { class: "numbers" }, words));
    return image ? `Pixel ${at[0]}, ${at[1]}: ${words}` : "";
  }

  async function fetchRaw(key) {
    raw = { key, at: Date.now(), image: raw?.key === key ? raw.image : null, pending: true };
    const mine = raw;
    try {
      const response = await call("GET", jobPath(job, `/preview?format=raw&frame=${state.frame}&view=${state.view}`), { accept: "*/*" });
      mine.image = decodeRaw(await response.arrayBuffer());
    } catch (failure) {
      if (!failure.problem) throw failure;
    }
    mine.pending = false;
    if (raw === mine && pixel && !closed) tellPixel(pixel);
  }

  ask();
  return {
    root,
    frame: (number) => set({ frame: number }),
    refresh: ask,
    live: (isLive) => {
      const ended = state.live && !isLive;
      state.live = isLive;
      if (ended) ask();
      if (!isLive && !front) write(wait.lastChild, "There is no picture");
      wait.firstChild.hidden = !isLive;
    },
    close: () => {
      closed = true;
      clearTimeout(timer);
      if (front) URL.revokeObjectURL(front.src);
      board.close();
    },
  };
}
