// This table shows where renders run: nodes with their slots, and the frames that run now.

import { element, fill } from "../base/dom.js";
import * as format from "../base/format.js";
import { table } from "./table.js";

export function workerTable() {
  const running = table("Workers", ["Job", "Frame", "Tenant", "Priority", "Done", "Phase", "CPU", "Since"], "No frame is rendered now.");
  const summary = element("p", { class: "note" });
  const nodes = element("ul", { class: "nodes" });
  running.root.querySelector("h2").after(summary, nodes);

  function show(found) {
    const away = found.dispatcher === "nowhere" ? " No server dispatches now." : "";
    fill(summary, `${format.plural(found.running.length, "frame")} on ${format.plural(found.slots, "slot")}, ${format.plural(found.cores, "core")}, ${format.bytes(found.memory_bytes)} for each render.${away}`);
    fill(nodes, found.nodes.length > 1 || found.nodes.some((node) => node.why) ? found.nodes.map((node) => element("li", {}, `${node.id}: ${node.why || format.plural(node.slots, "slot")}`)) : []);
    running.show(found.running.map((frame) => [`${frame.job} ${frame.frame}`, JSON.stringify(frame), () => cells(frame)]));
  }

  function cells(frame) {
    const since = element("time", { datetime: frame.started_at, class: "soft" }, format.when(frame.started_at));
    return [`${frame.name || "scene"} ${format.shortId(frame.job)}`, String(frame.time_code ?? frame.frame), frame.tenant, String(frame.priority), format.percent(frame.fraction), frame.phase || "–", format.duration(frame.cpu_s) || "–", since];
  }

  return { root: running.root, show };
}
