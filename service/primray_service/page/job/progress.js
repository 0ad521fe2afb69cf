// A job's progress: its phase, its error, its remaining time.

import { element, write } from "../base/dom.js";
import * as format from "../base/format.js";
import { TERMINAL, phaseWords } from "../base/words.js";

export function progress() {
  const bar = element("progress", { max: "1", value: 0, "aria-label": "Progress" });
  const phase = element("p", { class: "phase" });
  const left = element("p", { class: "left-time soft" });
  const cells = Object.fromEntries(["error", "target", "samples", "time", "rays", "frames"].map((name) => [name, element("dd", {})]));
  cells.error.append(element("span", { class: "large" }), element("small", {}));
  const names = { error: "Error now", target: "Target", samples: "Samples a pixel", time: "Time", rays: "Rays", frames: "Frames" };
  const list = element("dl", { class: "numbers-list" }, Object.entries(cells).map(([name, cell]) => element("div", {}, element("dt", {}, names[name]), cell)));
  const root = element("div", { class: "progress" }, element("div", { class: "phase-line" }, phase, left), bar, list);

  function show(job) {
    const found = job.progress ?? {};
    const ended = TERMINAL.has(job.state);
    write(phase, phaseWords(job));
    bar.value = job.state === "succeeded" ? 1 : (found.fraction ?? 0);
    bar.hidden = ended;
    write(left, ended ? "" : leftWords(found, job.state));
    const error = found.error;
    write(cells.error.firstChild, error ? format.error(error.estimate) : "–");
    write(cells.error.lastChild, error ? interval(error) : "");
    write(cells.target, targetWords(job));
    write(cells.samples, samplesWords(found));
    write(cells.time, format.duration(found.elapsed_s) || "–");
    cells.rays.parentElement.hidden = !(found.rays_per_s > 0);
    write(cells.rays, format.rate(found.rays_per_s));
    const frames = found.frames;
    cells.frames.parentElement.hidden = !(frames?.total > 1);
    if (frames?.total > 1) write(cells.frames, `${frames.succeeded} of ${frames.total}${frames.failed ? `, ${frames.failed} failed` : ""}`);
  }

  return { root, show };
}

function interval(error) {
  const [low, high] = error.ci95 ?? [];
  return Number.isFinite(low) && Number.isFinite(high) ? `95 %: ${format.error(low)} – ${format.error(high)}` : "";
}

function targetWords(job) {
  const stop = job.settings?.stop ?? {};
  const rules = [
    stop.target_error && `${format.error(stop.target_error)}${stop.metric && stop.metric !== "relmse" ? ` ${stop.metric}` : ""}`,
    stop.max_seconds && format.duration(stop.max_seconds),
    stop.max_samples && format.plural(stop.max_samples, "sample"),
  ].filter(Boolean);
  return rules.join(" or ") || "64 samples";
}

function samplesWords(found) {
  if (!found.samples_done) return "–";
  const spread = found.samples_min !== undefined && found.samples_min !== found.samples_max;
  return `${format.count(found.samples_done)}${spread ? ` (${format.count(found.samples_min)} – ${format.count(found.samples_max)})` : ""}`;
}

function leftWords(found, state) {
  if (["canceling", "pausing", "paused"].includes(state)) return "";
  if (!Number.isFinite(found.eta_s) || found.eta_s === null) return "";
  const [low, high] = found.eta_ci95 ?? [];
  const wide = Number.isFinite(low) && Number.isFinite(high) && high > 1.3 * low && high >= 2;
  return wide ? `${format.duration(low)} to ${format.duration(high)} left` : `about ${format.duration(found.eta_s)} left`;
}
