// Shows the view that the address's fragment names: #/ (new render), #/jobs, #/jobs/<id>, #/again/<id>, #/compare/<id>/<id>,
// #/admin. A view is a function (root, arguments) that fills its root and returns a function that ends it.
//
// Imports go one way: views/ (one for each address) uses scene/ (requests), job/ (a job's state), admin/ (the administrator's
// tables) and picture/ (pictures), none of which uses another. Below picture/ are exr/ (reads files) and layers/ (draws their
// channels).

import { keyNeeded } from "./base/api.js";
import { element, fill } from "./base/dom.js";
import { keyForm } from "./key_form.js";
import { watchServer } from "./server_line.js";
import { adminView } from "./views/admin_view.js";
import { againView } from "./views/again_view.js";
import { compareView } from "./views/compare_view.js";
import { jobView } from "./views/job_view.js";
import { jobsView } from "./views/jobs_view.js";
import { newView } from "./views/new_view.js";

const main = document.getElementById("main");
let leave = () => {};

const ROUTES = [
  [/^\/?$/, "new", newView],
  [/^\/jobs$/, "jobs", jobsView],
  [/^\/jobs\/([^/]+)$/, "jobs", jobView],
  [/^\/again\/([^/]+)$/, "new", againView],
  [/^\/admin$/, "admin", adminView],
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
  fill(root, element("section", { class: "card" }, element("h1", {}, "Page not found"), element("a", { href: "#/" }, "New render")));
}

addEventListener("hashchange", () => show(true));
keyNeeded.addEventListener("needed", (event) => keyForm(event.detail, () => show(false)));
watchServer(document.getElementById("server"));
show(false);
