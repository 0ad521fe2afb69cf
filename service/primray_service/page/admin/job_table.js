// This table shows the jobs of all tenants, and pauses, resumes, cancels them or changes their priority.

import { send } from "../base/api.js";
import { button, choice, element, field, fill, labelled } from "../base/dom.js";
import * as format from "../base/format.js";
import { STATES, TERMINAL, codeOf, phaseWords, stateWords } from "../base/words.js";
import { table } from "./table.js";

const PAGE = 25;
const PAUSED = new Set(["pausing", "paused"]);

export function jobTable({ changed, failed }) {
  const tenant = element("input", { type: "search", on: { change: restart } });
  const state = choice([["", "any state"], ...Object.entries(STATES)], "", { on: { change: restart } });
  const pages = element("div", { class: "pages" });
  const jobs = table("Jobs of all tenants", ["Job", "Tenant", "State", "Done", "Priority", "Created", "Actions"], "No job matches.");
  const bar = element("form", { class: "bar", on: { submit: (event) => (event.preventDefault(), restart()) } }, field("Tenant", tenant), field("State", state));
  jobs.root.querySelector("h2").after(bar);
  jobs.root.append(pages);
  let cursors = [null]; // of this page and the pages before it

  function restart() {
    cursors = [null];
    changed();
  }

  function query() {
    const parameters = new URLSearchParams({ limit: String(PAGE) });
    if (tenant.value.trim()) parameters.set("tenant", tenant.value.trim());
    if (state.value) parameters.set("state", state.value);
    if (cursors.at(-1)) parameters.set("cursor", cursors.at(-1));
    return parameters;
  }

  function show(page) {
    jobs.show(page.items.map((job) => [job.id, says(job), () => cells(job)]));
    const back = cursors.length > 1 && button("Page before", () => (cursors.pop(), changed()));
    const next = page.next_cursor && button("Next page", () => (cursors.push(page.next_cursor), changed()));
    fill(pages, back, next);
  }

  const says = (job) => JSON.stringify([job.name, job.state, job.priority, phaseWords(job), done(job)]);
  const done = (job) => format.percent(job.progress?.fraction ?? 0);

  function cells(job) {
    const name = `${job.name || "scene"} ${format.shortId(job.id)}`;
    const priority = labelled(`Priority of ${name}`, element("input", { type: "number", min: "0", max: "100", value: job.priority, on: { change: () => act(job, "PATCH", "", { priority: Number(priority.value) }) } }));
    const ended = TERMINAL.has(job.state);
    const doing = [
      PAUSED.has(job.state) && button("Resume", () => act(job, "POST", "/resume"), { "aria-label": `Resume ${name}` }),
      !ended && !PAUSED.has(job.state) && job.state !== "canceling" && button("Pause", () => act(job, "POST", "/pause"), { "aria-label": `Pause ${name}` }),
      !ended && job.state !== "canceling" && button("Cancel", () => act(job, "POST", "/cancel"), { "aria-label": `Cancel ${name}` }),
    ];
    const words = element("span", { class: "state", data: { state: job.state }, title: job.error?.detail || undefined }, ended ? stateWords(job.state) : phaseWords(job), job.error && `: ${codeOf(job.error)}`);
    const made = element("time", { datetime: job.created_at, class: "soft" }, format.when(job.created_at));
    return [element("span", { title: job.id }, name), job.tenant, words, ended || job.state === "queued" ? "" : done(job), ended ? String(job.priority) : priority, made, element("div", { class: "actions" }, doing)];
  }

  async function act(job, method, path, json) {
    try {
      await send(method, `/v1/admin/jobs/${encodeURIComponent(job.id)}${path}`, json);
      document.activeElement?.blur(); // so that the row shows its new state
      changed();
    } catch (failure) {
      failed(failure);
    }
  }

  return { root: jobs.root, show, query };
}
