// Asks for an API key in a dialog and exchanges it for a cookie, so that pictures and event streams, which carry no headers,
// are let in as well. The key itself is not kept in the page.

import { keyNeeded, send } from "./base/api.js";
import { element, field, fill } from "./base/dom.js";
import { problemBox } from "./base/problem_box.js";

let open = null;

// The server speaks of headers, to programs; people are told what happened to their session.
function reason(problem) {
  return /session/.test(problem?.detail ?? "") ? "Your session has ended." : "This server shows its jobs only to people with a key.";
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
      "Paste the key that you were given: it begins with “primray_”. If you have none, ask whoever runs this server, who makes one with ",
      element("code", {}, "primray keys create"),
      ".",
    ),
    field("API key", key, "It is sent once, for a cookie that only this browser has; it is not stored in the page."),
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
