// A job's settings and results: its problem if it failed, times, use of the machine.

import { element, fill } from "../base/dom.js";
import * as format from "../base/format.js";
import { problemBox } from "../base/problem_box.js";
import { STOPPED } from "../base/words.js";

// Returns the error with its confidence interval.
function errorOf(found) {
  if (!found) return undefined;
  const [low, high] = found.ci95 ?? [];
  return `${format.error(found.estimate)} (95 %: ${format.error(low)} – ${format.error(high)})`;
}

export function facts(id) {
  const failure = element("div", {}); // the problem of a failed job, which a view shows first
  const list = element("dl", { class: "facts" });
  const root = element("div", {}, element("details", { class: "card" }, element("summary", {}, "Settings and figures"), list));
  let written = "";

  function show(job, scene) {
    const settings = job.settings ?? {};
    const effective = job.effective_settings ?? {};
    const rows = [
      ["Job", job.id],
      ["Scene", scene?.name || job.scene.id],
      ["Root layer", job.scene.entry],
      ["Camera", effective.camera ?? settings.camera],
      ["Resolution", (effective.resolution ?? settings.resolution)?.join(" × ")],
      ["Frames", settings.frames],
      ["Seed", settings.seed],
      ["Priority", job.priority],
      ["Attempt", job.attempt],
      ["Created", format.when(job.created_at)],
      ["Started", format.when(job.started_at)],
      ["Ended", format.when(job.finished_at)],
      ["Stopped because", STOPPED[job.result?.stop?.reason] ?? job.result?.stop?.reason],
      ["Error", errorOf(job.result?.error)],
      ["Error, denoised", errorOf(job.result?.denoised)],
      ["CPU time", format.duration(job.usage?.cpu_s)],
      ["Peak memory", format.bytes(job.usage?.peak_rss_bytes)],
      ["Expires", format.when(job.expires_at)],
    ];
    const text = JSON.stringify(rows);
    if (text === written) return;
    written = text;
    fill(list, rows.filter(([, value]) => value !== undefined && value !== null && value !== "").map(([name, value]) => [element("dt", {}, name), element("dd", {}, typeof value === "object" ? JSON.stringify(value) : value)]));
  }

  let shown = "";
  function problem(found) {
    const text = JSON.stringify(found);
    if (text === shown) return;
    shown = text;
    const again = element("a", { class: "button main", href: `#/again/${encodeURIComponent(id)}` }, "Change the settings and submit again…");
    fill(failure, found && [problemBox(found), element("p", { class: "actions" }, again)]);
  }

  return { root, failure, show, problem };
}
