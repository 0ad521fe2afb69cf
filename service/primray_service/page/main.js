// Chooses the view by the address's fragment: #/ (new render), #/jobs, #/jobs/<id>, #/compare/<id>/<id>. A view is a function
// (root, arguments) that fills its root and answers a function that ends it.

import { keyNeeded } from "./api.js";
import { compareView } from "./compare_view.js";
import { element, fill } from "./dom.js";
import { jobView } from "./job_view.js";
import { jobsView } from "./jobs_view.js";
import { keyForm } from "./key_form.js";
import { newView } from "./new_view.js";
import { watchServer } from "./server_line.js";

const main = document.getElementById("main");
let leave = () => {};

const ROUTES = [
  [/^\/?$/, "new", newView],
  [/^\/jobs$/, "jobs", jobsView],
  [/^\/jobs\/([^/]+)$/, "jobs", jobView],
  [/^\/compare(?:\/([^/]+))?(?:\/([^/]+))?$/, "compare", compareView],
];

function show(moveFocus) {
  leave();
  leave = () => {};
  const path = location.hash.replace(/^#/, "").split("?")[0];
  const [pattern, page, view] = ROUTES.find(([pattern]) => pattern.test(path)) ?? [null, "", lost];
  for (const link of document.querySelectorAll("nav a[data-page]")) {
    if (link.dataset.page === page) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  document.title = "primray";
  main.dataset.page = page;
  fill(main);
  let words;
  try {
    words = (pattern?.exec(path) ?? []).slice(1).map((word) => word && word !== "-" ? decodeURIComponent(word) : undefined);
  } catch {
    return lost(main);
  }
  leave = view(main, words) ?? leave;
  if (moveFocus) main.focus({ preventScroll: false });
  return undefined;
}

function lost(root) {
  fill(root, element("section", { class: "card" }, element("h1", {}, "There is no such page"), element("a", { href: "#/" }, "New render")));
}

addEventListener("hashchange", () => show(true));
keyNeeded.addEventListener("needed", (event) => keyForm(event.detail, () => show(false)));
watchServer(document.getElementById("server"));
show(false);
