// Plots the error against time or samples on logarithmic axes, with its 95 % band and the target. uPlot is a global: it is
// loaded as a classic script.

import { button, element } from "../base/dom.js";
import * as format from "../base/format.js";

const HEIGHT = 220;

export function curve() {
  const box = element("div", { class: "plot" });
  const summary = element("p", { class: "unseen" });
  const byTime = button("time", () => choose("t_s"), { "aria-pressed": "true" });
  const bySamples = button("samples", () => choose("samples"), { "aria-pressed": "false" });
  const root = element(
    "figure",
    { class: "curve" },
    element("figcaption", {}, element("span", {}, "Error"), element("span", { class: "segments", role: "group", "aria-label": "Against" }, byTime, bySamples)),
    box,
    summary,
  );
  let across = "t_s";
  let rows = [];
  let target = null;
  let metric = "relmse";
  let plot = null;

  function choose(name) {
    across = name;
    byTime.setAttribute("aria-pressed", String(name === "t_s"));
    bySamples.setAttribute("aria-pressed", String(name === "samples"));
    make();
  }

  // `rows` are those of the convergence; rows that a logarithm cannot show are left out.
  function show(given, goal, measure) {
    rows = given.filter((row) => row[measure] > 0 && row.t_s > 0 && row.samples > 0);
    target = goal > 0 ? goal : null;
    const changed = measure !== metric;
    metric = measure;
    if (!plot || changed) make();
    else update();
    const last = rows.at(-1);
    summary.textContent = last
      ? `Error ${format.error(last[metric])} after ${format.duration(last.t_s)}${target ? `, target ${format.error(target)}` : ""}.`
      : "No error has been estimated yet.";
  }

  function data() {
    const xs = rows.map((row) => row[across]);
    const values = rows.map((row) => row[metric]);
    // The interval is a half-width or a pair, and belongs to one of the measures only.
    const low = rows.map((row) => bound(row, 0));
    const high = rows.map((row) => bound(row, 1));
    return [xs, high, low, values];
  }

  function bound(row, side) {
    const value = row.ci95?.[side];
    return Number.isFinite(value) && value > 0 ? value : row[metric];
  }

  // Axes span whole decades around the values, at least one, so that they do not change with every row.
  function decades(values, least) {
    const positive = values.filter((value) => value > 0);
    if (positive.length === 0) return least;
    const low = 10 ** Math.floor(Math.log10(Math.min(...positive)) + 1e-9);
    const high = 10 ** Math.ceil(Math.log10(Math.max(...positive)) - 1e-9);
    return [low, high > low ? high : 10 * low];
  }

  function make() {
    plot?.destroy();
    plot = null;
    if (!globalThis.uPlot || box.clientWidth === 0) return;
    const style = getComputedStyle(root);
    const color = (name) => style.getPropertyValue(name).trim();
    const only = (_, splits) => splits.map((value) => (isDecade(value) ? value : null));
    const axis = { stroke: color("--soft"), grid: { stroke: color("--line"), width: 1, filter: only }, ticks: { stroke: color("--line"), width: 1, size: 4 }, font: "11px system-ui, sans-serif" };
    const hidden = { stroke: "transparent", points: { show: false } };
    plot = new uPlot(
      {
        width: box.clientWidth,
        height: HEIGHT,
        legend: { show: false },
        cursor: { points: { size: 6 }, drag: { x: false, y: false } },
        scales: {
          x: { time: false, distr: 3, log: 10, range: () => decades(rows.map((row) => row[across]), [1, 10]) },
          y: { distr: 3, log: 10, range: () => decades([...rows.flatMap((row) => [row[metric], bound(row, 0), bound(row, 1)]), target], [0.001, 1]) },
        },
        axes: [
          { ...axis, size: 40, values: (_, splits) => splits.map((value) => (isDecade(value) ? short(value, across) : "")), label: across === "t_s" ? "seconds" : "samples a pixel", labelSize: 16, labelFont: "11px system-ui, sans-serif" },
          { ...axis, size: 48, values: (_, splits) => splits.map((value) => (isDecade(value) ? format.error(value) : "")) },
        ],
        series: [
          {},
          hidden,
          hidden,
          { stroke: color("--accent"), width: 2, points: { show: rows.length < 3, size: 6, fill: color("--accent") } },
        ],
        bands: [{ series: [1, 2], fill: color("--band") }],
        hooks: { setCursor: [showCursor], draw: [(self) => drawTarget(self, color("--goal"))] },
      },
      data(),
      box,
    );
  }

  // The line goes from edge to edge, whatever has been measured.
  function drawTarget(self, stroke) {
    if (!target) return;
    const { ctx, bbox } = self;
    const y = Math.round(self.valToPos(target, "y", true)) + 0.5;
    ctx.save();
    ctx.strokeStyle = stroke;
    ctx.fillStyle = stroke;
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.setLineDash([6 * devicePixelRatio, 4 * devicePixelRatio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.textAlign = "right";
    ctx.fillText(`target ${format.error(target)}`, bbox.left + bbox.width - 4, y - 5 * devicePixelRatio);
    ctx.restore();
  }

  function update() {
    plot.setData(data());
  }

  function showCursor(self) {
    const row = rows[self.cursor.idx];
    const caption = root.querySelector("figcaption span");
    caption.textContent = row
      ? `Error ${format.error(row[metric])} [${format.error(bound(row, 0))}, ${format.error(bound(row, 1))}] at ${format.duration(row.t_s)}, ${format.count(row.samples)} samples`
      : "Error";
  }

  const sized = new ResizeObserver(() => {
    if (plot && plot.width !== box.clientWidth && box.clientWidth > 0) plot.setSize({ width: box.clientWidth, height: HEIGHT });
    else if (!plot) make();
  });
  sized.observe(box);
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  scheme.addEventListener("change", make);
  const close = () => {
    sized.disconnect();
    scheme.removeEventListener("change", make);
    plot?.destroy();
    plot = null;
  };
  return { root, show, close };
}

const isDecade = (value) => value !== null && Math.abs(Math.log10(value) - Math.round(Math.log10(value))) < 1e-6;

function short(value, across) {
  if (across !== "t_s" && value >= 1000) return `${value / 1000}k`;
  return value >= 0.001 ? String(Number(value.toPrecision(1))) : format.error(value);
}
