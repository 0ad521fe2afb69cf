// The form with a render's settings, as the scene's check found them; it submits the job.

import { send, token } from "../base/api.js";
import { diagnostics } from "../base/diagnostics.js";
import { button, choice, element, field, fill, freshId, labelled, ticked, write } from "../base/dom.js";
import * as format from "../base/format.js";
import { problemBox } from "../base/problem_box.js";
import { QUALITIES } from "../base/words.js";
import { estimate, timeWords } from "./estimate.js";
import { factsOf } from "./facts.js";
import { outputsChoice } from "./outputs_choice.js";

const SCALES = [["1", "full"], ["0.5", "half"], ["0.25", "quarter"]];

const number = (attributes) => element("input", { type: "number", inputmode: "decimal", ...attributes });

// `server` is the answer of /v1/capabilities; `before` is a job of the scene whose settings the form begins with.
export function sceneForm(scene, server, before = null) {
  const facts = factsOf(scene);
  const was = before?.settings ?? {};
  const limits = server.limits ?? {};
  const outputs = outputsChoice(facts, server.aovs ?? [], before && was);
  const times = new Map(); // by quality: the element that shows its time
  const name = element("input", { type: "text", maxlength: "200", value: before?.name ?? scene.name ?? "", autocomplete: "off" });
  const entry = facts.entries.length > 1 ? choice(facts.entries.map((name) => [name, name]), before?.scene.entry ?? facts.entry) : null;
  const sameCamera = was.camera && facts.cameras.find(({ path }) => path === was.camera || path.split("/").at(-1) === was.camera);
  const camera = facts.cameras.length > 0 ? choice(facts.cameras.map(({ path }) => [path, path]), sameCamera?.path ?? facts.camera) : element("input", { type: "text", spellcheck: "false", value: was.camera ?? "" });
  const lost = was.camera && !sameCamera && facts.cameras.length > 0 && `${was.camera} was requested, but the stage does not have it`;
  const width = number({ min: "1", max: String(limits.image_side ?? 32768), step: "1", required: true });
  const height = number({ min: "1", max: String(limits.image_side ?? 32768), step: "1", required: true });
  const keep = element("input", { type: "checkbox", checked: true });
  const frames = element("input", { type: "text", placeholder: facts.frames || "1:10", spellcheck: "false", autocomplete: "off" });
  const range = element("input", { type: "checkbox", on: { change: () => (frames.disabled = !range.checked) } });
  const seconds = number({ min: "1", step: "any", value: before ? (was.stop?.max_seconds ?? "") : "600" });
  const samples = number({ min: "1", max: String(limits.samples ?? 2 ** 20), step: "1", placeholder: "no limit", value: was.stop?.max_samples ?? "" });
  const seed = number({ min: "0", max: String(2 ** 32 - 1), step: "1", value: was.seed ?? 0, required: true });
  const depth = number({ min: "1", step: "1", placeholder: "no limit", value: was.max_depth ?? "" });
  const clamp = number({ min: "0", step: "any", placeholder: "never", value: was.clamp_indirect ?? "" });
  const caustics = element("input", { type: "checkbox", checked: was.caustics ?? true });
  const priority = number({ min: "0", max: "100", step: "1", value: before?.priority ?? 50, required: true });
  const strict = element("input", { type: "checkbox", checked: was.strict });
  const light = element("input", { type: "checkbox", checked: was.default_light ?? true });
  const variants = facts.variants.map(({ prim, set, selection, names }) =>
    field(`${set} of ${prim}`, choice([["", `as in the scene: ${selection || "none"}`], ...names.map((each) => [`${prim}:${set}=${each}`, each])], variantOf(was, prim, set, names))),
  );
  const labels = element("textarea", { rows: "2", placeholder: "shot = 010", spellcheck: "false", value: textOf(before?.labels ?? {}) });
  const own = number({ min: "0", step: "any", placeholder: "0.005", "aria-label": "Own target error", on: { input: () => (form.elements.quality.value = "own"), focus: () => (form.elements.quality.value = "own") } });
  const trouble = element("div", {});
  const submit = element("button", { class: "main" }, "Render");
  const summary = element("p", { class: "note" });

  const timing = estimate(() => ({ job: job(), targets: targets(), pixels: width.value * height.value }), (found) => {
    [...times.values()].forEach((cell, index) => write(cell, timeWords(found[index])));
  });

  const form = element(
    "form",
    { class: "card settings", "aria-label": "Settings" },
    element("h2", {}, "Settings"),
    element(
      "div",
      { class: "columns" },
      field("Name", name, "for the job list"),
      entry && field("Root layer", entry),
      facts.cameras.length > 1 || (before && facts.cameras.length === 0) ? field("Camera", camera, lost) : element("div", { class: "field" }, element("span", { class: "name" }, "Camera"), element("span", {}, facts.cameras[0]?.path ?? "none in the scene: one is placed that sees everything")),
      element("fieldset", { class: "size" }, element("legend", {}, "Resolution"), labelled("Width", width), element("span", { "aria-hidden": "true" }, "×"), labelled("Height", height), ticked("keep the aspect ratio", keep), element("div", { class: "segments" }, SCALES.map(([scale, name]) => button(name, () => scaled(Number(scale)))))),
      element("fieldset", {}, element("legend", {}, "Frames"), ticked("several frames", range), frames, element("small", {}, facts.frames ? `The scene has ${facts.frames}. ` : "The scene names no range. ", "“1:10”, “1-10x2” or “1,5”")),
    ),
    element(
      "fieldset",
      { class: "qualities" },
      element("legend", {}, "Stop at"),
      QUALITIES.map(([value, name, hint], index) => quality(value, name, hint, index === 0)),
      quality("own", "Own error", own, false),
    ),
    timing.root,
    element("div", { class: "columns" }, field("Or after seconds", seconds, "of sampling, each frame"), field("Or after samples a pixel", samples)),
    outputs.root,
    variants.length > 0 && element("details", { open: variants.length <= 4 }, element("summary", {}, "Variants"), element("div", { class: "columns" }, variants)),
    element("details", {}, element("summary", {}, "More"), element("div", { class: "columns" }, field("Seed", seed), field("Maximum depth", depth, "1: direct light only"), field("Clamp indirect light at", clamp, "a bias; the render reports how much light it removed"), field("Priority", priority, "0 to 100; larger goes first"), field("Labels", labels, "name = value, one a line"), ticked("light a scene without lights", light), ticked("caustics", caustics), ticked("refuse a scene with warnings", strict))),
    trouble,
    element("div", { class: "submit" }, submit, summary),
  );

  function quality(value, name, hint, checked) {
    const radio = element("input", { type: "radio", name: "quality", value, id: freshId("quality"), checked });
    const text = typeof hint === "string" ? element("small", {}, hint) : hint;
    const time = element("small", { class: "time" });
    times.set(value, time);
    return element("div", { class: "quality" }, radio, element("label", { for: radio.id }, element("span", {}, name), typeof hint === "string" && text, time), typeof hint !== "string" && text);
  }

  const targets = () => [...times.keys()].map((value) => Number(value === "own" ? own.value : value));

  function cameraChanged() {
    const chosen = facts.cameras.find(({ path }) => path === camera.value);
    const side = was.resolution?.[0] || 960; // an earlier job's width, in the camera's aspect ratio
    const [w, h] = (was.resolution ? null : facts.resolution) ?? [side, Math.max(1, Math.round(side / (chosen?.aspect ?? 16 / 9)))];
    width.value = w;
    height.value = h;
    full = [w, h];
    showSummary();
  }

  let full = [960, 540];

  // Sets the earlier job's settings where they differ from the defaults.
  function begin() {
    const target = was.stop?.target_error;
    const known = QUALITIES.find(([value]) => Number(value) === target);
    form.elements.quality.value = known ? known[0] : "own";
    if (!known && target) own.value = target;
    if (was.resolution) [width.value, height.value] = full = [was.resolution[0] || "", was.resolution[1] || ""];
    showSummary();
  }

  function scaled(scale) {
    width.value = Math.max(1, Math.round(full[0] * scale));
    height.value = Math.max(1, Math.round(full[1] * scale));
    showSummary();
  }

  width.addEventListener("input", () => {
    if (keep.checked && width.value > 0) height.value = Math.max(1, Math.round((width.value * full[1]) / full[0]));
    showSummary();
  });
  height.addEventListener("input", () => {
    if (keep.checked && height.value > 0) width.value = Math.max(1, Math.round((height.value * full[0]) / full[1]));
    showSummary();
  });
  camera.addEventListener("change", cameraChanged);

  function showSummary() {
    const pixels = width.value * height.value;
    fill(summary, pixels > 0 ? `${format.count(pixels)} pixels` : "");
    timing.update();
  }

  function job() {
    const chosen = form.elements.quality.value;
    const stop = {
      ...was.stop,
      target_error: chosen === "own" ? optional(own) : Number(chosen),
      max_seconds: optional(seconds),
      max_samples: optional(samples),
    };
    const settings = {
      ...was,
      camera: camera.value || null,
      frames: range.checked ? frames.value.trim() || facts.frames || null : null,
      resolution: [Number(width.value), Number(height.value)],
      stop,
      seed: Number(seed.value),
      max_depth: optional(depth),
      clamp_indirect: optional(clamp),
      caustics: caustics.checked,
      default_light: light.checked,
      strict: strict.checked,
      variants: [...othersOf(was, facts.variants), ...variants.map((each) => each.querySelector("select").value).filter(Boolean)],
      ...outputs.settings(),
    };
    return { scene: { id: scene.id, ...(entry && { entry: entry.value }) }, settings, ...(name.value.trim() && { name: name.value.trim() }), priority: Number(priority.value), labels: labelsOf(labels.value, name.value.trim()) };
  }

  let key = token();
  let sent = "";
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const request = job();
    // The same request sent again after a lost answer is the same job; a changed request is another one.
    if (JSON.stringify(request) !== sent) key = token();
    sent = JSON.stringify(request);
    submit.disabled = true;
    fill(trouble);
    timing.close();
    try {
      const made = await send("POST", "/v1/jobs", request, { "idempotency-key": key });
      performance.mark("submitted");
      location.hash = `#/jobs/${encodeURIComponent(made.id)}`;
    } catch (failure) {
      if (!failure.problem) throw failure;
      fill(trouble, problemBox(failure.problem, { retryAfter: failure.retryAfter }));
      submit.disabled = false;
      submit.focus();
    }
  });

  frames.disabled = !was.frames;
  range.checked = Boolean(was.frames);
  frames.setAttribute("aria-label", "Frames");
  frames.value = was.frames ?? facts.frames;
  cameraChanged();
  if (before) begin();
  form.addEventListener("input", timing.update);
  form.addEventListener("change", timing.update);
  timing.history();
  const notes = diagnostics();
  notes.show(scene.warnings ?? []);
  const root = element("div", { class: "form-and-notes" }, form, (scene.warnings ?? []).length > 0 && notes.root);
  return { root, focus: () => submit.focus(), close: timing.close };
}

function variantOf(was, prim, set, names) {
  const chosen = names.map((each) => `${prim}:${set}=${each}`);
  return (was.variants ?? []).find((each) => chosen.includes(each)) ?? "";
}

// Returns the job's variants that have no control in the form.
function othersOf(was, offered) {
  const known = offered.map(({ prim, set }) => `${prim}:${set}=`);
  return (was.variants ?? []).filter((each) => !known.some((start) => each.startsWith(start)));
}

const textOf = (labels) => Object.entries(labels).filter(([name]) => name !== "name").map(([name, value]) => `${name} = ${value}`).join("\n");

const optional = (control) => (control.value === "" ? null : Number(control.value));

function labelsOf(text, name) {
  const labels = name ? { name } : {};
  for (const line of text.split("\n")) {
    const [label, ...rest] = line.split("=");
    if (label.trim()) labels[label.trim()] = rest.join("=").trim();
  }
  return labels;
}
