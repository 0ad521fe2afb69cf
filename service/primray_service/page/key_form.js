// Asks for an API key in a dialog and exchanges it for a cookie, so that pictures and event streams, which carry no headers,
// are let in as well. The key itself is not kept in the page.

import { keyNeeded, send } from "./base/api.js";
import { element, field, fill } from "./base/dom.js";
import { problemBox } from "./base/problem_box.js";

let open = null;

export function keyForm(problem, onDone) {
  if (open) return;
  const key = element("input", { type: "password", autocomplete: "current-password", required: true, spellcheck: "false" });
  const answer = element("div", {});
  const form = element(
    "form",
    { class: "card" },
    element("h2", { id: "key-title" }, "This server wants an API key"),
    element("p", {}, problem?.detail || "Its operator makes keys with “primray keys create”."),
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
