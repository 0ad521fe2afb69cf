// Estimates the time that a render takes to reach an error: from measurements of earlier jobs of the same scene and camera, or
// from a small pilot, which is rendered for it and deleted. Sampling time is proportional to the number of pixels; the error
// falls with a power of the number of samples.

import { call, get, jobPath, send } from "../base/api.js";
import { button, element, write } from "../base/dom.js";
import * as format from "../base/format.js";

const PILOT = { side: 240, seconds: 3, wait: 20 };
const LOOKED_AT = 5; // earlier jobs
const [LEAST_POWER, MOST_POWER] = [1, 1.5]; // of relMSE: 1 for independent samples, more if they are stratified or adaptive
const WIDE = 1.6; // a narrower interval is shown as one value

// `request()` returns {job, targets, pixels}: the job, target errors and pixels of the form; `show(times)` is called with
// {low, high} in seconds, or null, for each target.
export function estimate(request, show) {
  const words = element("span", { class: "note", role: "status" });
  const go = button("Estimate the times", () => pilot(), { class: "quiet" });
  const root = element("p", { class: "estimate" }, go, words);
  let known = null; // {key, each, start, samples, ci95, pixels, power}
  let saidOf = null; // the key of the measurements that the words describe
  let [running, closed] = [null, false];

  // Measurements apply to renders with the same camera, variants and so on.
  const keyOf = ({ settings, scene }) => JSON.stringify([scene, settings.camera, settings.variants ?? [], settings.purposes ?? null, settings.max_depth ?? null, settings.clamp_indirect ?? null, settings.caustics ?? true, settings.frames ?? null]);

  function update() {
    const { job, targets, pixels } = request();
    const key = keyOf(job);
    const isSame = known?.key === key;
    go.hidden = isSame || running !== null;
    show(targets.map((target) => (isSame && target > 0 && pixels > 0 ? timeTo(target, pixels) : null)));
    if (saidOf !== key && !running) say("", key);
  }

  function say(text, key) {
    saidOf = key;
    write(words, text);
  }

  // Returns seconds, {low, high}, for this number of pixels.
  function timeTo(target, pixels) {
    const of = (error) => (known.start + known.each * known.samples * (error / target) ** (1 / known.power)) * (pixels / known.pixels);
    return { low: of(known.ci95[0]), high: of(known.ci95[1]) };
  }

  async function history() {
    const { job } = request();
    try {
      const { items } = await get(`/v1/jobs?state=succeeded&limit=${LOOKED_AT}&scene=${encodeURIComponent(job.scene.id)}`);
      const found = items.find((each) => keyOf({ scene: job.scene, settings: each.settings }) === keyOf(job) && !each.parallel);
      if (found && !known && !closed) await learn(found, keyOf(job), "from an earlier render of it");
    } catch (failure) {
      if (!failure.problem) throw failure; // without earlier jobs, the pilot is offered
    }
  }

  async function learn(job, key, source) {
    const rows = (await get(jobPath(job.id, "/convergence?frame=0"))).filter(({ t_s, relmse }) => t_s > 0 && relmse > 0);
    const [first, last] = [rows[0], rows.at(-1)];
    if (!last || closed) return false;
    const isCourse = last.samples > first.samples && last.t_s > first.t_s;
    const each = isCourse ? (last.t_s - first.t_s) / (last.samples - first.samples) : last.t_s / last.samples;
    const power = isCourse ? Math.log(first.relmse / last.relmse) / Math.log(last.samples / first.samples) : 1;
    const [width, height] = job.effective_settings?.resolution ?? job.settings.resolution;
    known = {
      key, each,
      start: Math.max(0, first.t_s - each * first.samples), // time before sampling: pilots, photons
      samples: last.samples,
      ci95: last.ci95 ?? [last.relmse, last.relmse],
      pixels: width * height,
      power: Math.min(MOST_POWER, Math.max(LEAST_POWER, power || 1)),
    };
    say(`Times of sampling, ${source}.`, key);
    update();
    return true;
  }

  async function pilot() {
    const { job } = request();
    const key = keyOf(job);
    const [width, height] = job.settings.resolution;
    const scale = Math.min(1, PILOT.side / Math.max(width, height));
    const resolution = [width, height].map((side) => Math.max(1, Math.round(side * scale)));
    const settings = { ...job.settings, resolution, aovs: [], denoise: false, strict: false, stop: { max_seconds: PILOT.seconds } };
    go.hidden = true;
    say("A small picture is rendered for some seconds…", key);
    try {
      const made = await send("POST", "/v1/jobs", { ...job, settings, name: "estimate", labels: { estimate: "" }, ttl_s: 300 });
      running = made.id;
      const response = await call("GET", jobPath(made.id), { headers: { prefer: `wait=${PILOT.wait}` } });
      const ended = await response.json();
      if (closed) return;
      if (ended.error) say(ended.error.detail, key);
      else if (ended.state !== "succeeded") say("There is no estimate: the server is busy with other jobs.", key);
      else if (!(await learn(ended, key, "from a small picture"))) say(`There is no estimate: the small picture had no error after ${PILOT.seconds} s.`, key);
    } catch (failure) {
      if (!failure.problem) throw failure;
      say(failure.problem.detail, key);
    } finally {
      stop();
      update();
    }
  }

  // Deletes the pilot.
  function stop() {
    const id = running;
    running = null;
    if (id) call("DELETE", jobPath(id)).catch(() => {});
  }

  return {
    root,
    update,
    history,
    close: () => {
      closed = true;
      stop();
    },
  };
}

// Returns "about 12 s" or "10 s to 2 min".
export function timeWords(found) {
  if (!found) return "";
  const [low, high] = [found.low, found.high].map((seconds) => format.duration(rounded(Math.max(0.1, seconds))));
  return found.high > WIDE * found.low && low !== high ? `${low} to ${high}` : `about ${format.duration(rounded(Math.max(0.1, Math.sqrt(found.low * found.high))))}`;
}

// Rounds to the precision of an estimate: two digits, whole minutes.
function rounded(seconds) {
  if (seconds >= 120) return 60 * Math.round(seconds / 60);
  const unit = 10 ** (Math.floor(Math.log10(seconds)) - 1);
  return Math.round(seconds / unit) * unit;
}
