// The administrator's view of all tenants: jobs and actions on them; workers and the frames that they render; usage and
// quotas.

import { get } from "../base/api.js";
import { element, fill } from "../base/dom.js";
import { problemBox } from "../base/problem_box.js";
import { jobTable } from "../admin/job_table.js";
import { tenantTable } from "../admin/tenant_table.js";
import { workerTable } from "../admin/worker_table.js";

const LOOK_EVERY_S = 4;

export function adminView(root) {
  const trouble = element("div", {});
  const failed = (failure) => {
    if (!failure.problem) throw failure;
    fill(trouble, problemBox(failure.problem, { retry: load, retryAfter: failure.retryAfter }));
  };
  const jobs = jobTable({ changed: load, failed });
  const workers = workerTable();
  const tenants = tenantTable({ changed: load, failed });
  let [closed, timer] = [false, 0];

  fill(root, element("h1", {}, "Administration"), trouble, jobs.root, workers.root, tenants.root);

  async function load() {
    clearTimeout(timer);
    try {
      const found = await Promise.all([get(`/v1/admin/jobs?${jobs.query()}`), get("/v1/admin/workers"), get("/v1/admin/tenants?limit=200")]);
      if (closed) return;
      fill(trouble);
      jobs.show(found[0]);
      workers.show(found[1]);
      tenants.show(found[2]);
    } catch (failure) {
      if (!closed) failed(failure);
      if ([401, 403].includes(failure.problem?.status)) return; // another key is needed, which starts this view again
    }
    if (!closed) timer = setTimeout(load, 1000 * LOOK_EVERY_S);
  }

  load();
  return () => {
    closed = true;
    clearTimeout(timer);
  };
}
