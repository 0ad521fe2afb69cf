// This table shows each tenant's usage beside its quotas, which can be set.

import { send } from "../base/api.js";
import { button, element, field, fill } from "../base/dom.js";
import * as format from "../base/format.js";
import { table } from "./table.js";

const GIB = 2 ** 30;
// Quotas are shown in readable units: [member, name, one unit of the field].
const QUOTAS = [
  ["running_jobs", "Jobs that run at a time", 1],
  ["queued_jobs", "Jobs that wait", 1],
  ["stored_bytes", "Stored, GiB", GIB],
  ["cpu_s_per_day", "CPU hours a day", 3600],
  ["requests_per_s", "Requests a second", 1],
];

export function tenantTable({ changed, failed }) {
  const tenants = table("Usage and quotas", ["Tenant", "Waiting", "Running", "Stored", "CPU today", "CPU in all", "Actions"], "No tenant has a key yet.");
  const panel = element("div", {});
  tenants.root.append(panel);

  function show(page) {
    tenants.show(page.items.map((tenant) => [tenant.tenant, JSON.stringify(tenant), () => cells(tenant)]));
  }

  function cells(tenant) {
    const set = Object.keys(tenant.quotas_set).length > 0 && element("span", { class: "label" }, "quotas set");
    return [
      element("span", {}, tenant.tenant, " ", set),
      share(tenant.queued_jobs, String),
      share(tenant.running_jobs, String),
      share(tenant.stored_bytes, format.bytes),
      share(tenant.cpu_s_per_day, hours),
      hours(tenant.cpu_s_total),
      button("Quotas…", () => edit(tenant), { "aria-label": `Quotas of ${tenant.tenant}` }),
    ];
  }

  function edit(tenant) {
    const inputs = QUOTAS.map(([name, , unit]) => {
      const limit = tenant.quotas[name];
      return element("input", { type: "number", min: "0", step: "any", value: limit === null ? "" : Number((limit / unit).toPrecision(6)) });
    });
    const form = element(
      "form",
      { class: "continue", "aria-label": `Quotas of ${tenant.tenant}` },
      element("h3", {}, `Quotas of ${tenant.tenant}`),
      element("p", { class: "note" }, "They hold whatever its keys say. An empty field is no limit."),
      element("div", { class: "columns" }, QUOTAS.map(([, name], place) => field(name, inputs[place]))),
      element(
        "div",
        { class: "actions" },
        element("button", { class: "main" }, "Set"),
        Object.keys(tenant.quotas_set).length > 0 && button("Remove these quotas", () => act(tenant, "DELETE")),
        button("Not now", () => fill(panel)),
      ),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const quotas = {};
      QUOTAS.forEach(([name, , unit], place) => {
        const value = inputs[place].value === "" ? null : unit === GIB ? Math.round(Number(inputs[place].value) * unit) : Number(inputs[place].value) * unit;
        const shown = tenant.quotas[name] === null ? "" : String(Number((tenant.quotas[name] / unit).toPrecision(6)));
        if (inputs[place].value !== shown) quotas[name] = value; // fields that were not changed are not sent
      });
      act(tenant, "PATCH", quotas);
    });
    fill(panel, form);
    inputs[0].focus();
  }

  async function act(tenant, method, json) {
    try {
      await send(method, `/v1/admin/tenants/${encodeURIComponent(tenant.tenant)}/quotas`, json);
      fill(panel);
      changed();
    } catch (failure) {
      failed(failure);
    }
  }

  return { root: tenants.root, show };
}

const hours = (seconds) => (seconds < 60 ? `${Math.round(seconds)} s` : format.duration(seconds));
const share = ({ used, limit }, words) => (limit === null ? words(used) : `${words(used)} of ${words(limit)}`);
