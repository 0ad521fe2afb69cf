// A view under a notebook's cell: it draws pictures that the kernel sends, and sends it what the mouse and keys do. A picture that
// has been drawn is acknowledged; the kernel sends the next one after that.

import { explanation } from "../../live/page/explained.js";
import { errorWords, phaseWords, selectedWords, shareOf, sizeWords, stepWords } from "../../live/page/figures.js";
import { navigate, pointIn, watchKeys } from "../../live/page/navigate.js";
import { sender } from "../../live/page/sender.js";
import { lightMix } from "./lights.js";

const BUSY_AFTER_MS = 3000;
const LABEL =
  "The picture. Arrow keys turn it, with Shift they move it; + and - bring it nearer and farther; W, A, S, D, Q and E fly, F frames, R resets.";
const HINT =
  "Drag to turn, with Shift to move, with Alt to look around, with the right button to come nearer. Click to name what is there, with Ctrl to see what the pixel's light is made of; the wheel works after that.";
// Nothing in this text comes from a scene: what does is set as text.
const PARTS = `
  <div class="problem" data-part="problem" role="alert" hidden><strong data-part="title"></strong><p data-part="detail"></p><code data-part="where"></code></div>
  <div class="stage" data-part="stage" tabindex="0" role="img"><canvas data-part="canvas" width="1" height="1"></canvas></div>
  <p class="line"><span class="phase" data-part="phase">Waiting for the kernel</span>
    <progress data-part="share" max="1" aria-label="Share of the preparation that is done" hidden></progress>
    <span data-part="numbers"></span><span data-part="error"></span><span data-part="speed"></span></p>
  <p data-part="selected" aria-live="polite"><code data-part="prim"></code> <span class="note" data-part="about"></span></p>
  <div class="explained" data-part="explained" aria-live="polite" hidden></div>
  <div class="bar"><button type="button" data-part="frame">Frame all</button><button type="button" data-part="reset">Reset</button>
    <button type="button" data-part="asked" aria-pressed="false" title="Renders again, with the light of each light apart">Lights</button>
    <label data-part="cameras">Camera <select data-part="camera"></select></label>
    <label data-part="times" hidden>Frame <input type="range" step="1" data-part="time"><output data-part="now"></output></label></div>
  <div class="mix" data-part="mix" hidden><div data-part="lights"></div><p data-part="mixed" role="status"></p><code data-part="call"></code></div>
  <details class="diagnostics" data-part="diagnostics" hidden><summary data-part="count"></summary><ul data-part="rows"></ul></details>`;

function render({ model, el }) {
  const root = document.createElement("div");
  root.className = "primray-view";
  root.dataset.lmSuppressShortcuts = "true"; // JupyterLab's: its keys for cells are keys of the camera here
  root.innerHTML = PARTS;
  const part = Object.fromEntries([...root.querySelectorAll("[data-part]")].map((node) => [node.dataset.part, node]));
  part.stage.setAttribute("aria-label", LABEL);
  el.append(root);

  const front = Math.random().toString(36).slice(2);
  const answers = new Map(); // who waits for the answer to each command, by its number
  let last = 0;
  const commands = sender(post, (problem) => showProblem(problem));
  const mix = lightMix(part, commands.send);
  const pixel = explanation(part.explained);
  const drawn = drawing(part, (token) => {
    const step = commands.seen(token);
    if (step !== null) write(part.speed, stepWords(step));
  });

  function post(command) {
    const id = `${front}-${++last}`;
    model.send({ kind: "command", id, command });
    const busy = setTimeout(() => write(part.phase, "The kernel is busy, or has ended"), BUSY_AFTER_MS);
    return new Promise((resolve) =>
      answers.set(id, (problem) => {
        clearTimeout(busy);
        resolve(problem);
      }),
    );
  }

  async function hear(message, buffers) {
    if (message.kind === "answer") {
      answers.get(message.id)?.(message.problem);
      answers.delete(message.id);
    } else if (message.kind === "closed") {
      write(part.phase, "The view is closed");
    } else if (message.kind === "update") {
      try {
        if (message.picture) await drawn(message.picture, buffers[0]);
        show(message.state);
      } finally {
        model.send({ kind: "drawn", number: message.number });
      }
    }
  }

  function show(state) {
    root.dataset.phase = state.phase;
    write(part.phase, phaseWords(state));
    part.share.hidden = !state.doing;
    if (state.doing) part.share.value = shareOf(state.doing);
    if (state.picture > 0) {
      root.dataset.samples = state.samples;
      write(part.numbers, sizeWords(state));
      write(part.error, errorWords(state));
    }
    showProblem(state.problem && { title: "The stage cannot be rendered as it is now", detail: `${state.problem.code}: ${state.problem.message}`, where: state.problem.where });
    write(part.prim, state.selected?.prim ?? "");
    write(part.about, state.selected ? selectedWords(state.selected) : HINT);
    write(part.frame, state.selected ? "Frame selected" : "Frame all");
    pixel.show(state.explained);
    mix.show(state.lights);
    showCameras(state);
    showTimes(state);
    showDiagnostics(state);
  }

  function showProblem(problem) {
    part.problem.hidden = !problem;
    for (const name of ["title", "detail", "where"]) write(part[name], problem?.[name] ?? "");
  }

  let cameras = "";
  function showCameras(state) {
    const text = JSON.stringify([state.cameras, state.camera]);
    part.cameras.hidden = !(state.cameras?.length > 1);
    if (text === cameras) return;
    cameras = text;
    const own = state.cameras.includes(state.camera) ? [] : [["", "made for the stage"]];
    const options = [...own, ...state.cameras.map((path) => [path, path])].map(([value, name]) => new Option(name, value));
    part.camera.replaceChildren(...options);
    part.camera.value = state.camera ?? "";
  }

  function showTimes(state) {
    part.times.hidden = !state.times;
    if (!state.times || document.activeElement === part.time) return;
    [part.time.min, part.time.max] = state.times;
    part.time.value = state.time ?? state.times[0];
    write(part.now, state.time ?? "none");
  }

  let rows = "";
  function showDiagnostics({ diagnostics, counts }) {
    const text = JSON.stringify([diagnostics, counts]);
    if (text === rows) return;
    rows = text;
    part.diagnostics.hidden = diagnostics.length === 0;
    const all = Object.values(counts).reduce((sum, count) => sum + count, 0);
    const more = all > diagnostics.length ? `; the first ${diagnostics.length}` : "";
    write(part.count, `Of the scene: ${Object.entries(counts).map(([severity, count]) => `${count} ${severity}`).join(", ")}${more}`);
    part.rows.replaceChildren(
      ...diagnostics.map((row) => {
        const item = document.createElement("li");
        const place = document.createElement("code");
        place.textContent = [row.prim_path, row.attribute].filter(Boolean).join(" ");
        item.append(`${row.severity} ${row.code} `, place, ` ${row.message}`);
        return item;
      }),
    );
  }

  const isActive = () => root.contains(document.activeElement);
  navigate({ root: part.stage, pointOf: (event) => pointIn(part.canvas, event) }, commands, isActive);
  watchKeys(root, commands);
  root.addEventListener("keydown", (event) => event.stopPropagation()); // keys of the notebook
  part.frame.addEventListener("click", () => commands.send({ do: "frame" }));
  part.reset.addEventListener("click", () => commands.send({ do: "reset" }));
  part.camera.addEventListener("change", () => commands.send({ do: "camera", path: part.camera.value || null }));
  part.time.addEventListener("input", () => {
    write(part.now, part.time.value);
    commands.send({ do: "set", time_code: Number(part.time.value) });
  });
  model.on("msg:custom", hear);
  model.send({ kind: "shown", front });
  return () => {
    model.off("msg:custom", hear);
    model.send({ kind: "gone", front });
  };
}

// Draws pictures, each after the one before; `onToken` gets the token of the command that a picture is the first to show.
function drawing({ canvas, stage }, onToken) {
  const context = canvas.getContext("2d", { willReadFrequently: true }); // the GPU is not used
  let count = 0;
  return async ({ type, token }, bytes) => {
    const picture = await createImageBitmap(new Blob([bytes], { type }), { colorSpaceConversion: "none" });
    Object.assign(canvas, { width: picture.width, height: picture.height });
    context.drawImage(picture, 0, 0);
    stage.style.setProperty("--aspect", `${picture.width} / ${picture.height}`);
    stage.dataset.pictures = ++count;
    onToken(token);
  };
}

function write(node, text) {
  if (node.textContent !== String(text)) node.textContent = String(text);
}

export default { render };
