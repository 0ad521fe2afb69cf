// A new render: a file is dropped or chosen, packed if necessary, uploaded and checked; the form then offers what the scene
// contains.

import { get, known, scenePath, upload } from "../base/api.js";
import { button, element, fill, say, write } from "../base/dom.js";
import * as format from "../base/format.js";
import { problemBox } from "../base/problem_box.js";
import { filesOfDrop, filesOfInput, packed } from "../scene/dropped.js";
import { examples } from "../scene/examples.js";
import { sceneForm } from "../scene/form.js";

const LOOK_EVERY_S = 0.1;
const STEPS = [
  ["Drop", "a scene; it is checked, and what is in it is offered."],
  ["Choose", "how clean the picture is to be: an error, a time, or both."],
  ["Look", "at it as it refines, with its measured error, and take the EXR home."],
];

export function newView(root) {
  const file = element("input", { type: "file", multiple: true, class: "unseen", tabindex: "-1", "aria-hidden": "true", accept: ".usd,.usda,.usdc,.usdz,.zip,*" });
  const folder = element("input", { type: "file", webkitdirectory: true, class: "unseen", tabindex: "-1", "aria-hidden": "true" });
  const zone = element(
    "section",
    { class: "drop", "aria-label": "Scene" },
    element("h1", {}, "Drop a USD scene"),
    element("p", {}, ".usda, .usdc, .usdz, a zip, or a folder with everything the scene refers to"),
    element("p", { class: "actions" }, button("Choose a file", () => file.click(), { class: "main", id: "choose" }), button("Choose a folder", () => folder.click())),
    file,
    folder,
  );
  const steps = element("ol", { class: "steps", "aria-label": "How it goes" }, STEPS.map(([word, text]) => element("li", {}, element("strong", {}, word), ` ${text}`)));
  const offered = examples(begin, (failure) => fill(below, problemBox(failure.problem ?? { title: "The example is not available", detail: failure.message })));
  const first = element("div", { class: "first" }, steps, offered);
  const below = element("div", { class: "below" });
  let running = null;
  let closed = false;
  const server = get("/v1/capabilities").catch(() => ({}));
  let form = null;
  fill(root, zone, first, below);

  file.addEventListener("change", () => begin(filesOfInput(file.files)));
  folder.addEventListener("change", () => begin(filesOfInput(folder.files)));
  const over = (event) => {
    if (![...(event.dataTransfer?.types ?? [])].includes("Files")) return;
    event.preventDefault();
    zone.classList.toggle("over", event.type === "dragover");
  };
  const drop = async (event) => {
    over(event);
    zone.classList.remove("over");
    if (event.dataTransfer?.items.length) begin(await filesOfDrop(event.dataTransfer));
  };
  // The whole window accepts the file: a near miss must not make the browser leave the page.
  addEventListener("dragover", over);
  addEventListener("dragleave", over);
  addEventListener("drop", drop);

  async function begin(files) {
    running?.abort();
    form?.close();
    running = new AbortController();
    const { signal } = running;
    zone.classList.add("small");
    first.hidden = true;
    const bar = element("progress", { max: "1", "aria-label": "Upload" });
    const words = element("p", { class: "upload-words", role: "status" }, "Reading");
    const stop = button("Stop", () => running.abort(), { class: "quiet" });
    const name = element("strong", {}, files[0]?.file.name ?? "");
    const box = element("section", { class: "card upload" }, element("div", { class: "upload-head" }, name, stop), bar, words);
    fill(below, box);
    const progress = (sentence, done, total) => {
      if (total) bar.value = done / total;
      else bar.removeAttribute("value");
      write(words, sentence);
    };
    try {
      const size = files.reduce((sum, { file }) => sum + file.size, 0);
      const { name: called, blob, notes } = await packed(files, (done) => progress(`Packing: ${format.bytes(done)} of ${format.bytes(size)}`, done, size), signal);
      write(name, called);
      progress("Checking whether the server has it already");
      const started = performance.now();
      let scene = await known(blob);
      if (!scene) {
        scene = await upload(blob, called, (done, total) => progress(uploadWords(done, total, started), done, total), signal);
      }
      performance.mark("uploaded");
      progress("Checking the scene");
      scene = await checked(scene, signal);
      fill(box, element("div", { class: "upload-head" }, name, element("span", { class: "soft" }, format.bytes(scene.bytes ?? blob.size))), notes.map((note) => element("p", { class: "note" }, note)));
      if (scene.state === "rejected") {
        box.append(problemBox(scene.problem));
        return;
      }
      form = sceneForm(scene, await server);
      if (closed || signal.aborted) return;
      below.append(form.root);
      form.focus();
      say(`${called} is ready to render.`);
    } catch (failure) {
      if (signal.aborted || failure.name === "AbortError") {
        if (!closed && running.signal === signal) {
          fill(below, element("p", { class: "note" }, "Stopped."));
          first.hidden = false;
        }
        return;
      }
      const problem = failure.problem ?? { title: "This cannot be uploaded", detail: failure.message };
      fill(below, problemBox(problem, { retry: () => begin(files), retryAfter: failure.retryAfter }));
    }
  }

  return () => {
    closed = true;
    running?.abort();
    form?.close();
    removeEventListener("dragover", over);
    removeEventListener("dragleave", over);
    removeEventListener("drop", drop);
  };
}

function uploadWords(done, total, started) {
  const seconds = (performance.now() - started) / 1000;
  const left = done > 0 && seconds > 1 ? `, ${format.duration((seconds * (total - done)) / done)} left` : "";
  return `Uploading: ${format.bytes(done)} of ${format.bytes(total)}${left}`;
}

async function checked(scene, signal) {
  let found = scene;
  while (found.state === "checking") {
    await new Promise((resolve) => setTimeout(resolve, 1000 * LOOK_EVERY_S));
    found = await get(scenePath(scene.id), { signal });
  }
  return found;
}
