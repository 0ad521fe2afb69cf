// Requests an API key in a dialog and exchanges it for a cookie, so that images and event streams, which carry no headers, are
// authorized as well. The page does not store the key.

import { keyNeeded, send } from "./base/api.js";
import { element, field, fill } from "./base/dom.js";
import { problemBox } from "./base/problem_box.js";

let open = null;

// The server's message is about headers, for programs; people read what happened to their session.
function reason(problem) {
  return /session/.test(problem?.detail ?? "") ? "Your session has ended." : "This server requires a key.";
}

export function keyForm(problem, onDone) {
  if (open) return;
  const key = element("input", { type: "password", autocomplete: "current-password", required: true, spellcheck: "false" });
  const answer = element("div", {});
  const form = element(
    "form",
    { class: "card" },
    element("h2", { id: "key-title" }, "Log in with an API key"),
    element("p", {}, reason(problem)),
    element(
      "p",
      {},
      "Paste the key that you were given: it begins with “primray_”. If you have none, ask the server's operator, who creates keys with ",
      element("code", {}, "primray keys create"),
      ".",
    ),
    field("API key", key, "It is sent once, in exchange for a cookie of this browser; the page does not store it."),
    answer,
    element("button", { class: "main" }, "Log in"),
  );
  open = element("dialog", { "aria-labelledby": "key-title" }, form);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      await send("POST", "/v1/session", { key: key.value.trim() });
      key.value = "";
      keyNeeded.since = performance.now();
      open.close();
    } catch (failure) {
      fill(answer, problemBox(failure.problem));
      key.select();
    }
  });
  open.addEventListener("close", () => {
    open.remove();
    open = null;
    document.dispatchEvent(new Event("logged-in"));
    onDone();
  });
  document.body.append(open);
  open.showModal();
  key.focus();
}
