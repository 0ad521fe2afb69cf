// The job list: names, thumbnails and positions in the queue; filters by name, state and label; pages; two jobs can be chosen
// and compared.

import { get, jobPath } from "../base/api.js";
import { button, choice, element, field, fill, say } from "../base/dom.js";
import * as format from "../base/format.js";
import { problemBox } from "../base/problem_box.js";
import { STATES, TERMINAL, codeOf, phaseWords, stateWords } from "../base/words.js";

const PAGE = 25;
const SEARCHED = 200; // jobs that a name is searched in: the newest, or the oldest, of the chosen state and label
const LOOK_EVERY_S = 4;

export function jobsView(root) {
  const state = choice([["", "any state"], ...Object.entries(STATES)], "", { on: { change: restart } });
  const name = element("input", { type: "search", placeholder: "part of a name", on: { input: () => draw(), change: restart } });
  const label = element("input", { type: "search", placeholder: "shot: 010", on: { change: restart } });
  const order = choice([["desc", "newest first"], ["asc", "oldest first"]], "desc", { on: { change: restart } });
  const list = element("ul", { class: "jobs" });
  const pages = element("div", { class: "pages" });
  const trouble = element("div", {});
  const chosen = new Set();
  const compare = element("a", { class: "button", href: "#/compare", hidden: true }, "Compare the two");
  let cursors = [null]; // of this page and the pages before it
  let next = null;
  let items = [];
  let closed = false;
  let timer = 0;
  let loads = 0; // counts requests: an answer that a newer request overtook is dropped

  fill(
    root,
    element("h1", {}, "Jobs"),
    element("form", { class: "bar", on: { submit: (event) => (event.preventDefault(), restart()) } }, field("Name", name), field("State", state), field("Label", label), field("Order", order), compare),
    trouble,
    list,
    pages,
  );

  function restart() {
    cursors = [null];
    load();
  }

  async function load() {
    clearTimeout(timer);
    const mine = ++loads;
    const query = new URLSearchParams({ limit: String(name.value.trim() ? SEARCHED : PAGE), order: order.value });
    if (state.value) query.set("state", state.value);
    for (const words of label.value.split(",").filter((text) => text.trim())) query.append("label", labelOf(words));
    if (cursors.at(-1)) query.set("cursor", cursors.at(-1));
    try {
      const page = await get(`/v1/jobs?${query}`);
      if (closed || mine !== loads) return;
      next = page.next_cursor;
      fill(trouble);
      items = page.items;
      draw();
    } catch (failure) {
      if (closed || mine !== loads) return;
      if (failure.problem) fill(trouble, problemBox(failure.problem, { retry: load, retryAfter: failure.retryAfter }));
    }
    timer = setTimeout(() => (document.hidden || root.contains(document.activeElement) && document.activeElement.matches("select") ? later() : load()), 1000 * LOOK_EVERY_S);
  }

  function later() {
    timer = setTimeout(load, 1000 * LOOK_EVERY_S);
  }

  function draw() {
    const words = name.value.toLowerCase().split(/\s+/).filter(Boolean);
    const matching = items.filter((job) => words.every((word) => `${nameOf(job)} ${Object.values(job.labels ?? {}).join(" ")}`.toLowerCase().includes(word)));
    const focused = document.activeElement?.dataset?.key;
    fill(list, matching.map(row));
    if (focused) list.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
    if (matching.length === 0) fill(list, element("li", { class: "empty" }, state.value || label.value || words.length ? "No job matches." : "There are no jobs yet. ", !state.value && !words.length && element("a", { href: "#/" }, "Render the first one")));
    const back = cursors.length > 1 && button("Page before", () => (cursors.pop(), load()));
    const on = next && button("Next page", () => (cursors.push(next), load()));
    const looked = words.length > 0 && next && element("span", { class: "note" }, `Searched in the ${order.value === "desc" ? "newest" : "oldest"} ${SEARCHED} jobs.`);
    fill(pages, back, on, looked);
  }

  function row(job) {
    const mark = element("input", { type: "checkbox", "aria-label": `Choose ${nameOf(job)} to compare`, data: { key: `mark ${job.id}` }, on: { change: choose } });
    mark.checked = chosen.has(job.id);
    const error = job.progress?.error;
    return element(
      "li",
      { data: { state: job.state } },
      mark,
      thumb(job),
      element("a", { href: `#/jobs/${encodeURIComponent(job.id)}`, data: { key: job.id } }, nameOf(job)),
      element("span", { class: "state", title: job.error?.detail || undefined }, TERMINAL.has(job.state) ? stateWords(job.state) : phaseWords(job), job.error && `: ${codeOf(job.error)}`),
      element("span", { class: "soft" }, TERMINAL.has(job.state) || job.state === "queued" ? "" : format.percent(job.progress?.fraction ?? 0)),
      element("span", { class: "soft numbers" }, error?.estimate > 0 ? `error ${format.error(error.estimate)}` : ""),
      element("span", { class: "labels" }, labels(otherLabels(job))),
      element("time", { datetime: job.created_at, class: "soft" }, format.when(job.created_at)),
    );

    function choose() {
      if (mark.checked) chosen.add(job.id);
      else chosen.delete(job.id);
      compare.hidden = chosen.size !== 2;
      compare.href = `#/compare/${[...chosen].map(encodeURIComponent).join("/")}`;
      say(chosen.size === 2 ? "Two jobs are chosen: they can be compared." : `${format.plural(chosen.size, "job")} chosen.`);
    }
  }

  load();
  return () => {
    closed = true;
    clearTimeout(timer);
  };
}

// "shot: 010" and "shot=010" are the same label; a word alone is a name.
function labelOf(text) {
  const [name, ...rest] = text.split(/[:=]/);
  return rest.length ? `${name.trim()}:${rest.join(":").trim()}` : `name:${name.trim()}`;
}

export const otherLabels = (job) => Object.fromEntries(Object.entries(job.labels ?? {}).filter(([name]) => name !== "name"));

// A small picture, if there is one. A browser shows a cached image for an address that is already in this document; the
// fragment makes the address of a picture with more samples another one.
function thumb(job) {
  const none = element("span", { class: "thumb" });
  if (!(job.progress?.pass > 0)) return none;
  // A worker writes its first picture when the first request for it arrives.
  const on = { error: (event) => event.target.replaceWith(none) };
  return element("img", { on, class: "thumb", alt: "", loading: "lazy", width: 80, height: 45, src: `${jobPath(job.id, "/preview?width=160&format=jpeg")}#${job.progress.samples_done}` });
}

export const nameOf = (job) => `${job.name || job.labels?.name || job.scene?.name || job.scene?.entry || "scene"} ${format.shortId(job.id)}`;

export function labels(found) {
  return Object.entries(found ?? {}).map(([name, value]) => element("span", { class: "label" }, value === "" ? name : `${name}: ${value}`));
}
