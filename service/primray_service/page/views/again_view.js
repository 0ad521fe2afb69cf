// Submits a job again: shows why it failed, if it did, and the form with its settings, which can be changed.

import { get, jobPath, scenePath } from "../base/api.js";
import { element, fill } from "../base/dom.js";
import { problemBox } from "../base/problem_box.js";
import { sceneForm } from "../scene/form.js";

export function againView(root, [id]) {
  const below = element("div", { class: "below" });
  const title = element("h1", {}, "Submit again");
  let form = null;
  let closed = false;
  fill(root, element("div", { class: "head" }, title, element("a", { class: "button", href: `#/jobs/${encodeURIComponent(id)}` }, "Back to the job")), below);

  async function load() {
    try {
      const job = await get(jobPath(id));
      const [scene, server] = await Promise.all([get(scenePath(job.scene.id)), get("/v1/capabilities").catch(() => ({}))]);
      if (closed) return;
      form = sceneForm(scene, server, job);
      fill(title, `Submit ${job.name || scene.name || "the job"} again`);
      fill(below, job.error && problemBox(job.error), form.root);
    } catch (failure) {
      if (!failure.problem) throw failure;
      if (!closed) fill(below, problemBox(failure.problem, { retry: load, retryAfter: failure.retryAfter }));
    }
  }

  load();
  return () => {
    closed = true;
    form?.close();
  };
}
