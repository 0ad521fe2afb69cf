// The line at the top right: who is asking, and how to log out where keys are used; the link to what administrators see.

import { call, get } from "./base/api.js";
import { button, element, fill } from "./base/dom.js";

const adminLink = document.getElementById("admin-link");

export async function watchServer(line) {
  const tell = async () => {
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
  addEventListener("focus", tell);
  document.addEventListener("logged-in", tell);
  await tell();
}

async function logOut() {
  await call("DELETE", "/v1/session").catch(() => {});
  location.reload();
}
