// Actions on a job: cancel, continue to a lower error, delete, render again with other settings, compare, read its log.

import { jobPath, send } from "../base/api.js";
import { button, element, field, fill } from "../base/dom.js";
import * as format from "../base/format.js";
import { TERMINAL } from "../base/words.js";

export function actions(id, { changed, failed }) {
  const row = element("div", { class: "actions" });
  const panel = element("div", {});
  const root = element("div", {}, row, panel);
  const self = { root, show, onContinued: () => {}, onDelete: () => {} };
  let drawn = "";

  function show(job) {
    const kind = TERMINAL.has(job.state) ? "ended" : { canceling: "canceling", pausing: "paused", paused: "paused" }[job.state] ?? "going";
    if (kind === drawn) return;
    drawn = kind;
    fill(panel);
    fill(
      row,
      kind === "paused" && button("Resume", () => run(() => send("POST", jobPath(id, "/resume"))), { class: "main", title: "Its frames continue from where they were" }),
      kind === "going" && button("Pause", () => run(() => send("POST", jobPath(id, "/pause"))), { title: "Gives its workers back and keeps what was rendered" }),
      (kind === "going" || kind === "paused") && button("Cancel", () => run(() => send("POST", jobPath(id, "/cancel"))), { title: "Stops it and keeps the picture made so far" }),
      kind === "ended" && button("Continue…", () => goOn(job), { class: job.state === "failed" ? "" : "main" }),
      kind === "ended" && element("a", { class: "button", href: `#/again/${encodeURIComponent(id)}` }, "Submit again…"),
      element("a", { class: "button", href: `#/compare/${encodeURIComponent(id)}` }, "Compare"),
      element("a", { class: "button", href: jobPath(id, "/log"), target: "_blank", rel: "noopener" }, "Log"),
      kind === "ended" && button("Delete", remove, { class: "danger" }),
    );
  }

  async function run(what) {
    try {
      await what();
      changed();
    } catch (failure) {
      if (!failure.problem) throw failure;
      failed(failure);
    }
  }

  function goOn(job) {
    const stop = job.settings?.stop ?? {};
    const reached = job.progress?.error?.estimate;
    const lower = Math.min(...[stop.target_error, reached].filter((value) => value > 0)) / 4;
    const target = number(Number.isFinite(lower) ? Number(lower.toPrecision(2)) : 0.001, "any");
    const seconds = number(stop.max_seconds ? 4 * stop.max_seconds : "", "any");
    const samples = number(stop.max_samples ? 4 * stop.max_samples : "", "1");
    const form = element(
      "form",
      { class: "continue" },
      element("p", { class: "note" }, reached ? `It continues from an error of ${format.error(reached)}.` : "It continues from where it ended."),
      field("Target error", target),
      field("Or seconds in all", seconds),
      field("Or samples a pixel in all", samples),
      element("div", { class: "actions" }, element("button", { class: "main" }, "Continue rendering"), button("Not now", () => fill(panel))),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const value = (control) => (control.value === "" ? null : Number(control.value));
      run(async () => {
        await send("POST", jobPath(id, "/continue"), { stop: { target_error: value(target), max_seconds: value(seconds), max_samples: value(samples) } });
        drawn = "";
        self.onContinued();
      });
    });
    fill(panel, form);
    target.focus();
    target.select();
  }

  // The question is part of the page: a browser's own dialog blocks everything, the picture too.
  function remove() {
    const sure = button("Delete it", async () => {
      self.onDelete(true);
      try {
        await send("DELETE", jobPath(id));
        location.hash = "#/jobs";
      } catch (failure) {
        self.onDelete(false);
        if (!failure.problem) throw failure;
        failed(failure);
      }
    }, { class: "danger" });
    fill(panel, element("div", { class: "continue" }, element("p", {}, "Its pictures and files are deleted with it."), element("div", { class: "actions" }, sure, button("Keep it", () => fill(panel)))));
    sure.focus();
  }

  return self;
}

const number = (value, step) => element("input", { type: "number", min: "0", step, value, inputmode: "decimal" });
