// Adds "Try it" to every operation of /docs: a form made from the server's own OpenAPI document. Requests go to this server
// only, since a service accepts changes only from its own pages, and the page's policy allows no other address.

import { element, field, fill, say } from "../base/dom.js";
import { showAnswer, showFailure } from "./answer.js";
import { requestForm } from "./request_form.js";

const SERVER_OF_EXAMPLES = "http://127.0.0.1:8700";
const spec = await (await fetch("/openapi.json")).json();
const known = new Map(); // values of answers that other requests need: ids of jobs and scenes
const key = element("input", { type: "password", autocomplete: "off", spellcheck: "false" });

const hint = `Requests go to ${location.origin}. Each carries the key, which is not stored; on loopback none is needed.`;
const keyForm = element("form", { on: { submit: (event) => event.preventDefault() } }, field("API key", key, hint));
fill(document.getElementById("key"), keyForm);
for (const example of document.querySelectorAll(".operation pre")) {
  example.textContent = example.textContent.replaceAll(SERVER_OF_EXAMPLES, location.origin);
}
for (const [path, methods] of Object.entries(spec.paths)) {
  for (const [method, operation] of Object.entries(methods)) {
    document.getElementById(operation.operationId).append(tryIt(method.toUpperCase(), path, operation));
  }
}
openSchema();
addEventListener("hashchange", openSchema);

// A form is made when it is first opened: there are dozens.
function tryIt(method, path, operation) {
  const folded = element("details", { class: "try" }, element("summary", {}, "Try it"));
  folded.addEventListener("toggle", () => {
    if (folded.querySelector("form")) return;
    const answer = element("div", { class: "answer" });
    const form = requestForm(spec, method, path, operation, known, (request) => send(request, operation, form, answer));
    folded.append(form.root, answer);
  });
  return folded;
}

async function send({ url, ...options }, operation, form, answer) {
  const stop = new AbortController();
  const headers = { ...options.headers, ...(key.value.trim() && { authorization: `Bearer ${key.value.trim()}` }) };
  const began = performance.now();
  form.busy(stop);
  fill(answer);
  try {
    const response = await fetch(url, { ...options, headers, signal: stop.signal, credentials: "same-origin", cache: "no-store" });
    say(`Status ${response.status}`);
    const found = await showAnswer(answer, response, performance.now() - began);
    if (response.ok) remember(operation.responses[response.status]?.links, found);
  } catch (reason) {
    showFailure(answer, stop.signal.aborted ? "Stopped." : `No answer: ${reason.message}`);
    say("No answer");
  } finally {
    form.busy(null);
  }
}

// An answer's links name the parameters of other operations that its id is for (OpenAPI 3.1, 4.8.20).
function remember(links, found) {
  for (const link of Object.values(links ?? {})) {
    for (const [name, from] of Object.entries(link.parameters ?? {})) {
      if (from === "$response.body#/id" && found?.id) known.set(name, found.id);
    }
  }
  document.dispatchEvent(new Event("known"));
}

function openSchema() {
  const named = document.getElementById(location.hash.slice(1));
  if (named?.tagName !== "DETAILS") return;
  named.open = true;
  named.scrollIntoView();
}
