// The line at the top right: which server this is, who is asking, and how to log out where keys are used.

import { call, get } from "./base/api.js";
import { button, element, fill } from "./base/dom.js";

export async function watchServer(line) {
  const tell = async () => {
    try {
      const who = await get("/v1/whoami");
      fill(
        line,
        who.tenant && who.key !== null ? element("span", { class: "who" }, who.name || who.tenant) : null,
        who.session || who.key ? button("Log out", logOut, { class: "quiet" }) : null,
      );
    } catch {
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
