// Histogram of the values that are shown: of colours by stops, with clipped ones; of amounts over their range.

import { element, write } from "../base/dom.js";
import * as format from "../base/format.js";
import { single } from "./paint.js";

const [BINS, HEIGHT] = [240, 72];
const [LEAST, MOST] = [-10, 6]; // stops from white
const PICKED = 2 ** 18; // pixels at most
const COLORS = ["rgb(200 50 50)", "rgb(50 170 60)", "rgb(60 90 220)"]; // added where they overlap
const GREY = "rgb(140 140 140)";

export function histogram() {
  const canvas = element("canvas", { width: BINS, height: HEIGHT, role: "img", "aria-label": "Histogram" });
  const words = element("p", { class: "note" });
  const root = element("details", { class: "histogram" }, element("summary", {}, "Histogram"), canvas, words);
  let [shown, wanted] = [null, null];
  root.addEventListener("toggle", () => (wanted ? make() : draw()));

  function show(layer, stops) {
    [shown, wanted] = [layer ? { layer, stops } : null, null];
    root.hidden = !layer || layer.kind === "ids" || layer.kind === "mattes";
    draw();
  }

  // Shows a layer that is fetched only when the histogram is open: `fetchLayer()` resolves to [layer, stops], or null.
  function later(fetchLayer) {
    wanted = fetchLayer;
    root.hidden = false;
    make();
  }

  async function make() {
    if (!root.open || !wanted) return;
    const mine = wanted;
    const made = await mine().catch(() => null);
    if (made && mine === wanted) show(...made);
  }

  function draw() {
    if (!root.open || !shown || root.hidden) return;
    const { layer, stops } = shown;
    const isColor = layer.kind === "color";
    const context = canvas.getContext("2d");
    context.clearRect(0, 0, BINS, HEIGHT);
    const series = isColor ? byStops(layer, stops) : byRange(layer);
    const most = Math.max(1, ...series.bins.flatMap((bins) => [...bins].slice(1, -1)));
    context.globalCompositeOperation = isColor ? "lighter" : "source-over";
    series.bins.forEach((bins, number) => {
      context.fillStyle = series.bins.length > 1 ? COLORS[number] : GREY;
      bins.forEach((count, bin) => {
        const height = Math.min(HEIGHT, (HEIGHT * Math.sqrt(count)) / Math.sqrt(most));
        context.fillRect(bin, HEIGHT - height, 1, height);
      });
    });
    if (isColor) {
      context.globalCompositeOperation = "source-over";
      context.fillStyle = GREY;
      context.fillRect(Math.round(((0 - LEAST) / (MOST - LEAST)) * BINS), 0, 1, HEIGHT);
    }
    write(words, series.words);
    canvas.setAttribute("aria-label", `Histogram. ${series.words}`);
  }

  return { root, show, later };
}

function byStops(layer, stops) {
  const factor = 2 ** stops;
  const bins = [0, 1, 2].map(() => new Uint32Array(BINS));
  const one = single(layer.planes, "rgb");
  const [picked, stride] = pickedOf(layer);
  let [white, black] = [0, 0];
  for (let at = 0; at < layer.width * layer.height; at += stride) {
    for (let channel = 0; channel < 3; channel += 1) {
      const place = (Math.log2(Math.max(1e-9, factor * layer.planes[channel][at])) - LEAST) / (MOST - LEAST);
      bins[channel][Math.min(BINS - 1, Math.max(0, Math.floor(BINS * place)))] += 1;
    }
    const light = factor * one(at);
    if (light > 1) white += 1;
    if (!(light > 2 ** LEAST)) black += 1;
  }
  return { bins, words: `From −${-LEAST} to +${MOST} stops around white (the line), at this exposure. Above white ${format.percentOf(white / picked)}, black ${format.percentOf(black / picked)} of the pixels.` };
}

function byRange(layer) {
  const [picked, stride] = pickedOf(layer);
  const one = layer.planes.length === 3 ? single(layer.planes, "rgb") : (at) => layer.planes[0][at];
  const values = [];
  for (let at = 0; at < layer.width * layer.height; at += stride) if (Number.isFinite(one(at))) values.push(one(at));
  values.sort((a, b) => a - b);
  const bins = new Uint32Array(BINS);
  if (values.length === 0) return { bins: [bins], words: "There is nothing finite in it." };
  const at = (share) => values[Math.round(share * (values.length - 1))];
  const [low, high] = [at(0), at(1)];
  for (const value of values) bins[Math.min(BINS - 1, Math.floor((BINS * (value - low)) / (high - low || 1)))] += 1;
  const without = picked - values.length;
  return { bins: [bins], words: `From ${format.error(low)} to ${format.error(high)}, half of it below ${format.error(at(0.5))}.${without ? ` ${format.percent(without / picked)} of the pixels have no value.` : ""}` };
}

// Returns the number of pixels that are counted, and the step between them.
function pickedOf({ width, height }) {
  const stride = Math.ceil((width * height) / PICKED);
  return [Math.ceil((width * height) / stride), stride];
}
