// A problem document as a box: what happened, where, and what can be done about it.

import { button, element } from "./dom.js";
import { adviceFor } from "./words.js";

const SAID_ELSEWHERE = new Set(["type", "title", "status", "detail", "retryable", "errors", "warnings", "instance"]);
const PLACES = {
  layer: "Layer",
  line: "Line",
  column: "Column",
  code: "Code",
  asset_path: "Path in the scene",
  prim: "Prim",
  member: "Place",
  candidates: "Root layers found",
  signal: "Signal",
  limit: "Allowed",
  count: "Found",
  asked: "Requested",
  where: "Where",
  state: "State",
  scope: "Scope",
  frame: "Frame",
  attempt: "Attempt",
  quota: "Quota",
  request_id: "Request",
};

export function problemBox(problem, { retry, retryAfter } = {}) {
  const advice = adviceFor(problem);
  const wait = retryAfter ? ` The server asks to wait ${retryAfter} s.` : "";
  return element(
    "section",
    { class: "problem", role: "alert" },
    element("h3", {}, problem.title || "Something failed"),
    problem.detail && element("p", {}, problem.detail),
    places(problem),
    errors(problem.errors),
    (advice || wait) && element("p", { class: "advice" }, advice + wait),
    retry && button("Try again", retry),
  );
}

function places(problem) {
  const found = Object.entries(problem).filter(([name, value]) => !SAID_ELSEWHERE.has(name) && value !== null && value !== "");
  if (found.length === 0) return null;
  return element(
    "dl",
    { class: "places" },
    found.map(([name, value]) => [
      element("dt", {}, PLACES[name] ?? name.replaceAll("_", " ")),
      element("dd", {}, worded(value)),
    ]),
  );
}

function worded(value) {
  if (Array.isArray(value)) return value.map(worded).join(", ");
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}

// Members of the request that were refused, one a line.
function errors(found) {
  if (!Array.isArray(found) || found.length === 0) return null;
  return element(
    "ul",
    {},
    found.map((item) => {
      return element("li", {}, item.member && element("code", {}, String(item.member)), " ", item.detail ?? "");
    }),
  );
}
