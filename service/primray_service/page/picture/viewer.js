// Viewer of a job's picture: while it refines (the server's previews), and, once it has a file, of each of its parts (drawn
// here from their numbers). It has values under the pointer, exposure, channels, false colours and a histogram, and explains
// the light of a pixel.

import { choice, button, element, field, fill, write } from "../base/dom.js";
import { histogram } from "../layers/histogram.js";
import { paint } from "../layers/paint.js";
import { explainedPixel } from "./explained_pixel.js";
import { legend } from "./legend.js";
import { lightSliders } from "./light_sliders.js";
import { EXPOSE_AFTER_S, KEY_STOPS, LOOKS, lookOf } from "./looks.js";
import { partsOf } from "./parts.js";
import { player } from "./player.js";
import { region } from "./region.js";
import { pixelValues } from "./pixel_values.js";
import { rawOf } from "./raw_image.js";
import { served } from "./served.js";
import { stage } from "./stage.js";

const VIEWS = [["beauty", "Picture"], ["error", "Error"], ["relative-error", "Error, relative"]];
const CHANNELS = [["rgb", "Colour"], ["r", "Red"], ["g", "Green"], ["b", "Blue"], ["a", "Alpha"], ["luminance", "Luminance"]];
const PART = "part:";
const MOST_PREVIEWED = 2 ** 20; // pixels that a preview has at full resolution

export function viewer(job, { onFirst = () => {}, onRegion = () => {}, onPlayed = () => {} } = {}) {
  const waiting = element("span", {}, "Waiting for the first picture");
  const pulse = element("span", { class: "pulse" });
  const wait = element("p", { class: "wait" }, pulse, waiting);
  const keys = { words: "E and Shift E expose, V shows the next view, Enter explains the light of the picked pixel, Escape closes that", press: onKey };
  const board = stage("The picture", { onPixel: (at) => values.showAt(at), onAsk: explain, keys });
  const canvas = element("canvas", { hidden: true });
  board.root.append(wait);
  board.sheet.prepend(canvas);
  const state = { frame: null, view: "beauty", channel: "rgb", exposure: 0, look: "display" };
  const weights = new Map(); // of lights in the mix
  const sliders = lightSliders(weights, () => draw());
  const parts = partsOf(weights);
  let found = []; // the files of the shown frame, with their parts
  let [layer, front] = [null, null]; // the layer that is drawn here, if any; the server's <img>
  let fileSettings = {}; // of the job: view, display, look, exposure
  let frontSize = [1, 1]; // of the whole picture
  let [isLive, closed, exposeTimer, drawing] = [true, false, 0, 0];

  const view = choice(VIEWS, "beauty", { on: { change: () => turnTo(view.value) } });
  const channel = choice(CHANNELS, "rgb", { on: { change: () => change({ channel: channel.value }) } });
  const look = choice(LOOKS, "display", { on: { change: () => change({ look: look.value }) } });
  const exposure = element("input", { type: "range", min: "-8", max: "8", step: "0.25", value: "0", on: { input: expose } });
  const stops = element("output", { class: "stops" }, "0");
  const reset = button("Reset", () => {
    exposure.value = "0";
    expose();
    exposure.focus();
  }, { class: "quiet", hidden: true, "aria-label": "Reset exposure" });
  const [note, meaning] = [element("p", { class: "note", role: "status" }), element("p", { class: "note" })];
  const [colors, counts] = [legend(), histogram()];
  const values = pixelValues(job, shown, layerOfIds);
  const pictures = served(job, { onImage, onScale: (scale) => !layer && colors.show(scale), onTrouble: (text) => write(note, text), onSeen: (seen) => !layer && write(meaning, seen ? `Seen through “${seen}”` : "") });
  const exposureField = element("div", { class: "field exposure" }, element("label", { for: (exposure.id = "exposure") }, "Exposure, stops"), exposure, stops, reset);
  const mark = region(board, onRegion);
  const explained = explainedPixel(job, () => board.root.focus());
  const [channelField, lookField] = [field("Channel", channel), field("Look", look)];
  const bar = element("div", { class: "bar" }, field("View", view), channelField, lookField, exposureField);
  const playing = player(job, board.sheet, { query: () => (isPart() ? { view: "beauty" } : { view: state.view, channel: state.channel, exposure: state.exposure }), onFrame: onPlayed });
  board.tools.prepend(playing.root, mark.toggle);
  const under = element("div", { class: "under" }, element("div", {}, values.root, colors.root, meaning), board.tools);
  const root = element("div", { class: "viewer" }, board.root, under, explained.root, bar, sliders.root, mark.panel, note, counts.root);

  const chosen = () => found.flatMap(({ layers }) => layers).find(({ key }) => PART + key === state.view);
  const isPart = () => state.view.startsWith(PART);
  const size = () => (layer ? [layer.fullWidth, layer.fullHeight] : frontSize);

  function shown() {
    return { frame: state.frame, layer: isPart() ? layer : null, image: layer ? canvas : front, size: size(), isLive };
  }

  function expose() {
    const value = Number(exposure.value);
    write(stops, `${value > 0 ? "+" : ""}${value}`);
    exposure.setAttribute("aria-valuetext", `${value} stops`);
    reset.hidden = value === 0;
    clearTimeout(exposeTimer);
    exposeTimer = setTimeout(() => change({ exposure: value }), 1000 * EXPOSE_AFTER_S);
  }

  function explain(at) {
    if (isLive) explained.refuse("Pixels are explained when the job has ended.");
    else explained.ask(state.frame ?? 0, at);
  }

  // "E" is brighter, "Shift E" darker, as in other viewers of pictures. Returns whether it handled the key.
  function onKey(key) {
    if (key === "Escape") return explained.close();
    if (key === "e" || key === "E") {
      exposure.value = String(Number(exposure.value) + (key === "e" ? KEY_STOPS : -KEY_STOPS));
      expose();
      return true;
    }
    if (key !== "v" && key !== "V") return false;
    const options = [...view.options];
    turnTo(options.at((view.selectedIndex + (key === "v" ? 1 : -1)) % options.length).value);
    return true;
  }

  function turnTo(name) {
    view.value = name;
    change({ view: name });
  }

  function change(changes) {
    Object.assign(state, changes);
    arrange();
    draw();
  }

  function arrange() {
    const kind = isPart() ? chosen()?.kind : state.view === "beauty" ? "color" : "error";
    channelField.hidden = !["color", "error"].includes(kind);
    lookField.hidden = kind !== "color";
    exposureField.hidden = kind !== "color" && isPart();
    sliders.show(isPart() && chosen()?.lights ? chosen() : null);
  }

  const drawsHere = () => isPart() || (state.view === "beauty" && state.look !== "display");

  // Only the newest drawing counts.
  async function draw() {
    const mine = ++drawing;
    if (!drawsHere()) {
      const wasHere = layer !== null;
      layer = null;
      canvas.hidden = true;
      if (front) front.hidden = false;
      write(meaning, "");
      if (front && wasHere) board.size(...size());
      pictures.set({ frame: state.frame, view: state.view, channel: state.channel, exposure: state.exposure });
      pictures.pause(false);
      countPreview(mine);
      return;
    }
    try {
      const next = await layerNow();
      const seen = next && (await lookOf(state.look, next, state.exposure, state.channel, fileSettings));
      if (mine !== drawing || closed || !next) return;
      pictures.pause(isPart());
      layer = next;
      write(note, "");
      write(meaning, isPart() ? aboutOf(next, seen, state.look) : "");
      sliders.tell(next.relmse ?? null);
      colors.showScale(paint(canvas, next, seen));
      counts.show(next, state.exposure);
      canvas.hidden = false;
      if (front) front.hidden = true;
      board.size(...size());
      hasPicture();
      values.again();
    } catch (failure) {
      if (mine === drawing && !closed) write(note, failure.message);
    }
  }

  async function layerNow() {
    if (!isPart()) return rawOf(job, state.frame);
    found = await parts.of(state.frame);
    values.forget(); // another file may have other prims
    return (await chosen()?.read()) ?? null;
  }

  // The histogram of the server's picture is of the values behind it, which are fetched when it is open.
  async function countPreview(mine) {
    counts.show(null);
    if (state.view !== "beauty" || !front) return;
    counts.later(async () => {
      const made = await rawOf(job, state.frame);
      return mine === drawing ? [made, state.exposure] : null;
    });
  }

  async function layerOfIds(frame) {
    const files = await parts.of(frame);
    const layers = (files.find((file) => file.layers.some(({ key }) => PART + key === state.view)) ?? files[0])?.layers ?? [];
    const best = layers.find(({ part }) => part.name === "prim") ?? layers.find(({ kind, part }) => kind === "mattes" && part.name === "crypto_object");
    return best ? best.read() : null;
  }

  function onImage(next, before, whole) {
    next.hidden = layer !== null;
    [front, frontSize] = [next, whole];
    if (!layer) board.size(...whole);
    board.sheet.prepend(next);
    hasPicture();
    if (!before) onFirst();
    if (drawsHere() && !isPart()) draw();
    else if (!layer) countPreview(drawing);
  }

  function hasPicture() {
    wait.remove();
    root.dataset.pictures = String(Number(root.dataset.pictures ?? 0) + 1);
  }

  // Lists the parts that can be chosen now.
  async function offer() {
    const frame = state.frame;
    const now = await parts.of(frame).catch((failure) => {
      if (!closed) write(note, `Its parts cannot be shown: ${failure.message}`);
      return [];
    });
    if (closed || frame !== state.frame) return;
    found = now;
    const before = view.value;
    const shown = now[0]?.layers.find(({ part }) => part.name === "denoised"); // previews of ended frames show it
    const isTwice = ({ kind, part }) => shown && kind === shown.kind && part === shown.part && part.width * part.height <= MOST_PREVIEWED;
    const views = VIEWS.map(([value, text]) => [value, shown && value === "beauty" && !isLive ? shown.label : text]);
    fill(
      view,
      element("optgroup", { label: isLive ? "As it refines" : "As it ended" }, views.map(option)),
      now.map(({ name, layers }) => element("optgroup", { label: `Parts of ${name}` }, layers.filter((each) => isLive || !isTwice(each)).map(({ key, label }) => option([PART + key, label])))),
    );
    const isThere = [...view.options].some(({ value }) => value === before);
    view.value = isThere ? before : "beauty";
    if (!isThere) change({ view: "beauty" });
    values.forget();
  }

  arrange();
  return {
    root,
    refresh: () => pictures.refresh(),
    // Sets whether a region can be rendered by itself: only of a whole picture.
    regions: (width, height) => {
      mark.toggle.hidden = !width;
      if (width) mark.size(width, height);
    },
    frame: (number, has) => {
      if (number === state.frame) return;
      pictures.isThere(has);
      explained.close();
      change({ frame: number });
      offer();
    },
    // Sets the job's settings that its files are displayed with.
    settings: (now) => (fileSettings = now ?? {}),
    // Sets the ended frames, which are played at the stage's rate.
    sequence: playing.know,
    // Sets the job's outputs, as listed.
    files: (outputs) => {
      parts.know(outputs);
      offer();
    },
    live: (now, has) => {
      isLive = now;
      pictures.live(now, has);
      pulse.hidden = !now;
      if (!now) offer();
      write(waiting, now ? "Waiting for the first picture" : "There is no picture");
    },
    close: () => {
      closed = true;
      explained.close();
      clearTimeout(exposeTimer);
      playing.close();
      pictures.close();
      parts.close();
      board.close();
    },
  };
}

function aboutOf(layer, { view, isFalse }, look) {
  const why = !layer.isLight ? ": it is not light" : look === "display" ? ": its colour space is not known here" : "";
  const seen = layer.kind === "color" && !isFalse && (view ? `Shown as in the PNG, through “${view.view}”` : `Drawn as plain sRGB${why}`);
  const sparse = layer.step > 1 && `One in ${layer.step} of its rows and columns is shown`;
  return [layer.meaning, seen, sparse].filter(Boolean).join(". ");
}

const option = ([value, text]) => element("option", { value }, text);
