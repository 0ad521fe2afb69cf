// The line at the top right: the caller's name, and a button to log out if keys are used; it also shows the administrator's
// link.

import { call, get } from "./base/api.js";
import { button, element, fill } from "./base/dom.js";

const adminLink = document.getElementById("admin-link");

export async function watchServer(line) {
  const refresh = async () => {
    try {
      const who = await get("/v1/whoami");
      adminLink.hidden = !who.scopes.includes("admin");
      fill(
        line,
        who.tenant && who.key !== null ? element("span", { class: "who" }, who.name || who.tenant) : null,
        who.session || who.key ? button("Log out", logOut, { class: "quiet" }) : null,
      );
    } catch {
      adminLink.hidden = true;
      fill(line);
    }
  };
  addEventListener("focus", refresh);
  document.addEventListener("logged-in", refresh);
  await refresh();
}

async function logOut() {
  await call("DELETE", "/v1/session").catch(() => {});
  location.reload();
}
