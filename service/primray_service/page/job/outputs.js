// The files of a job: size, digest, download.

import { get, jobPath } from "../base/api.js";
import { button, element, fill, say, write } from "../base/dom.js";
import * as format from "../base/format.js";

export function outputs(job) {
  const list = element("ul", { class: "files" });
  const root = element("section", { class: "card", hidden: true, "aria-label": "Downloads" }, element("h2", {}, "Downloads"), list);

  async function load() {
    const { items } = await get(jobPath(job, "/outputs"));
    root.hidden = items.length === 0;
    fill(list, items.map(row));
    return items;
  }

  function row(output) {
    const link = element("a", { href: jobPath(job, `/outputs/${encodeURIComponent(output.name)}`), download: output.name }, output.name);
    const digest = output.sha256.replace("sha256:", "");
    const copy = button("Copy SHA-256", async () => {
      try {
        await navigator.clipboard.writeText(digest);
        write(copy, "Copied");
        say("SHA-256 copied");
        setTimeout(() => write(copy, "Copy SHA-256"), 2000);
      } catch {
        write(copy, digest); // there is no clipboard without https: show all of the digest, so that it can be selected
      }
    }, { class: "quiet" });
    return element(
      "li",
      {},
      link,
      element("span", { class: "soft" }, format.bytes(output.bytes), " · ", element("code", { title: digest }, digest.slice(0, 12))),
      copy,
    );
  }

  return { root, load };
}
