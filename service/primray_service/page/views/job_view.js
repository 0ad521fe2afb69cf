// One job: its picture as it refines, its progress, its error against the target, its frames, notes on the scene, files.

import { get, jobPath, scenePath, send } from "../base/api.js";
import { diagnostics } from "../base/diagnostics.js";
import { element, fill, say, write } from "../base/dom.js";
import * as format from "../base/format.js";
import { problemBox } from "../base/problem_box.js";
import { TERMINAL, phaseWords } from "../base/words.js";
import { actions } from "../job/actions.js";
import { curve } from "../job/curve.js";
import { facts } from "../job/facts.js";
import { frameStrip } from "../job/frame_strip.js";
import { live } from "../job/live.js";
import { outputs } from "../job/outputs.js";
import { progress } from "../job/progress.js";
import { viewer } from "../picture/viewer.js";
import { labels, otherLabels } from "./jobs_view.js";

const LOOK_EVERY_S = 5; // if there is no event stream
const CURVE_EVERY_S = 0.9;
const SAY_EVERY_S = 15;
const READ_EVERY_S = 1;

export function jobView(root, [id]) {
  const title = element("h1", {});
  const tags = element("span", { class: "labels" });
  const state = element("span", { class: "state" });
  const link = element("p", { class: "note", role: "status" });
  const trouble = element("div", {});
  const picture = viewer(id, { onFirst: () => performance.mark("first-pixel"), onRegion: renderRegion, onPlayed: (number) => strip.choose(number) });
  const bar = progress();
  const plot = curve();
  const notes = diagnostics();
  const files = outputs(id);
  const strip = frameStrip(id, chooseFrame, retryFrame, (frames) => {
    picture.sequence(frames.filter((each) => each.state === "succeeded").map((each) => each.number), scene?.frame_range?.fps);
  });
  const details = facts(id);
  const doing = actions(id, { changed: refresh, failed: (failure) => fill(trouble, problemBox(failure.problem, { retryAfter: failure.retryAfter })) });
  let job = null;
  let scene = null;
  let rows = { frame: -1, attempt: 0, items: [] };
  let frame = 0;
  let chosen = null; // the row of the frame that is shown, if the job has several
  let [closed, timer, saidAt, saidPhase, curveAt, curveTimer] = [false, 0, 0, "", 0, 0];
  let isEnding = false;
  let soonTimer = 0;
  let [refreshing, again] = [false, false];
  let [ended, gone] = [false, false];

  fill(
    root,
    element("div", { class: "head" }, title, state, tags),
    trouble,
    details.failure,
    element(
      "div",
      { class: "job" },
      element("div", { class: "left" }, picture.root, strip.root, notes.root),
      element("div", { class: "right" }, element("section", { class: "card", "aria-label": "Progress" }, bar.root, doing.root, link), element("section", { class: "card", "aria-label": "Error" }, plot.root), files.root, details.root),
    ),
  );

  // Only one request runs at a time; changes meanwhile cause one more.
  async function refresh() {
    if (refreshing || gone) {
      again = !gone;
      return;
    }
    refreshing = true;
    try {
      do {
        again = false;
        await read();
      } while (again && !closed && !gone);
    } finally {
      refreshing = false;
    }
  }

  async function read() {
    try {
      const found = await get(jobPath(id));
      if (closed) return;
      await show(found);
      if (!closed) fill(trouble);
    } catch (failure) {
      if (closed || gone) return;
      if (!failure.problem) throw failure;
      gone = failure.problem.status === 404;
      fill(trouble, problemBox(failure.problem, { retry: gone ? null : refresh, retryAfter: failure.retryAfter }));
      if (gone) {
        events.stop();
        clearInterval(timer);
        picture.live(false, false);
      }
    }
  }

  async function show(found) {
    const terminal = TERMINAL.has(found.state);
    const wasEnded = ended && job?.attempt === found.attempt && job.finished_at === found.finished_at;
    job = found;
    ended = terminal;
    draw();
    if (!scene) {
      scene = await get(scenePath(job.scene.id)).catch(() => ({}));
      draw();
    }
    const frames = job.progress?.frames?.total ?? 1;
    if (frames > 1) await strip.load(frames);
    else chooseFrame(0, null);
    await loadCurve();
    if (terminal) {
      events.stop(); // if it stayed open, the browser would reconnect again and again
      clearInterval(timer);
      write(link, "");
    }
    if (terminal && !wasEnded) {
      picture.live(false, hasPicture());
      picture.files(await files.load());
      say(`${title.textContent}: ${phaseWords(job)}.`);
    } else if (!terminal) {
      picture.live(true, hasPicture());
      if ((job.progress?.frames?.succeeded ?? 0) > 0) picture.files(await files.load());
    }
  }

  function draw() {
    const name = job.name || job.labels?.name || scene?.name || job.scene.entry || "Scene";
    write(title, name);
    fill(tags, labels(otherLabels(job)));
    write(state, phaseWords(job));
    state.dataset.state = job.state;
    const fraction = job.progress?.fraction ?? 0;
    document.title = `${ended ? phaseWords(job) : format.percent(fraction)} · ${name} · primray`;
    picture.settings(job.settings);
    bar.show(job);
    doing.show(job);
    details.show(job, scene);
    const whole = job.settings.region ? [0, 0] : (job.effective_settings?.resolution ?? job.settings.resolution ?? [0, 0]);
    picture.regions(...whole);
    notes.show(merged(scene?.warnings, job.warnings));
    if (job.error) details.problem(job.error);
    else details.problem(null);
    announce();
  }

  // Renders a part of the picture with the same settings, as another job beside this one.
  async function renderRegion(region) {
    const frames = (job.progress?.frames?.total ?? 1) > 1 ? { frames: String(chosen?.time_code ?? 1) } : {};
    const request = { scene: { id: job.scene.id, ...(job.scene.entry && { entry: job.scene.entry }) }, settings: { ...job.settings, ...frames, region }, name: `region of ${title.textContent}`.slice(0, 200), priority: job.priority, labels: job.labels };
    try {
      location.hash = `#/jobs/${encodeURIComponent((await send("POST", "/v1/jobs", request)).id)}`;
    } catch (failure) {
      if (!failure.problem) throw failure;
      fill(trouble, problemBox(failure.problem, { retryAfter: failure.retryAfter }));
    }
  }

  async function retryFrame(number) {
    try {
      await send("POST", jobPath(id, `/frames/${number}/retry`));
      await refresh();
      follow();
    } catch (failure) {
      if (!failure.problem) throw failure;
      fill(trouble, problemBox(failure.problem, { retryAfter: failure.retryAfter }));
    }
  }

  function announce() {
    const words = phaseWords(job);
    if (ended || (words === saidPhase && Date.now() - saidAt < 1000 * SAY_EVERY_S)) return;
    saidAt = Date.now();
    saidPhase = words;
    const estimate = job.progress?.error?.estimate;
    say(`${words}, ${format.percent(job.progress?.fraction ?? 0)}${estimate ? `, error ${format.error(estimate)}` : ""}`);
  }

  async function loadCurve() {
    clearTimeout(curveTimer);
    const wait = 1000 * CURVE_EVERY_S - (performance.now() - curveAt);
    if (!ended && wait > 0 && rows.frame === frame) {
      curveTimer = setTimeout(loadCurve, wait);
      return;
    }
    curveAt = performance.now();
    try {
      const found = await get(jobPath(id, `/convergence?frame=${frame}`));
      if (closed) return;
      rows = { frame, items: found };
    } catch (failure) {
      if (!failure.problem || failure.problem.status === 0) return;
      rows = { frame, items: [] };
    }
    const stopRules = job.settings?.stop ?? {};
    plot.show(rows.items, stopRules.target_error ?? null, metricOf(rows.items, stopRules.metric ?? "relmse"));
  }

  function chooseFrame(number, row) {
    const isOther = frame !== number;
    frame = number;
    chosen = row;
    picture.frame(number, hasPicture());
    picture.live(!ended, hasPicture());
    if (isOther) loadCurve();
  }

  // A request for a picture that cannot be there yet only causes errors in a browser's console.
  const hasPicture = () => (chosen ?? job).progress?.samples_done > 0;

  function onEvent(type, data) {
    if (type === "end" && data.attempt === job?.attempt) isEnding = true; // the server closes the stream now
    if (type === "preview") {
      if (job && data.frame === frame) picture.refresh();
    } else if (type === "progress" && job && (data.progress ?? data).fraction !== undefined && (job.progress?.frames?.total ?? 1) === 1) {
      job = { ...job, progress: { ...job.progress, ...(data.progress ?? data) } };
      draw();
      loadCurve();
    } else if (type === "queue" && job) {
      job = { ...job, queue: data };
      draw();
    } else if (type === "progress") soon();
    else refresh();
  }

  // In a job with many frames, events come faster than its frames should be read again.
  function soon() {
    soonTimer ||= setTimeout(() => {
      soonTimer = 0;
      refresh();
    }, 1000 * READ_EVERY_S);
  }

  const events = live(jobPath(id, "/events"), {
    onEvent,
    onOpen: () => {
      write(link, "");
      clearInterval(timer);
      refresh();
    },
    onLost: () => {
      if (ended || isEnding) return;
      write(link, "The connection was lost; trying again.");
      clearInterval(timer);
      timer = setInterval(refresh, 1000 * LOOK_EVERY_S);
    },
  });

  function follow() {
    isEnding = false;
    events.start();
  }

  doing.onContinued = follow;
  // Files that may be deleted must not be requested.
  doing.onDelete = (now) => {
    gone = now;
    picture.live(false, false);
    if (now) events.stop();
    else follow();
  };
  refresh().then(() => !ended && !closed && !gone && follow());
  return () => {
    closed = true;
    events.stop();
    clearInterval(timer);
    clearTimeout(curveTimer);
    clearTimeout(soonTimer);
    picture.close();
    plot.close();
  };
}

const metricOf = (rows, metric) => (rows.some((row) => row[metric] !== undefined) ? metric : "relmse");

// The check and the render may report the same thing.
function merged(...lists) {
  const seen = new Map();
  for (const row of lists.flatMap((list) => list ?? [])) seen.set(JSON.stringify([row.code, row.prim, row.detail]), row);
  return [...seen.values()];
}
