// The page of `primray view`: a picture that follows mouse, files and choices, and its state. The server does the work: it
// sends its state as events; the page fetches the picture that a state names and sends the user's actions.

import { diagnostics } from "../page/base/diagnostics.js";
import { element, fill, write } from "../page/base/dom.js";
import { panel } from "./panel.js";
import { picture, watchKeys } from "./picture.js";
import { onRefused, stage } from "./server.js";

const PHASES = { opening: "Opening", drafting: "Drafting", rendering: "Refining", finished: "Finished", failed: "Failed" };

const looked = picture();
const chosen = panel();
const found = diagnostics();
const problem = element("div", { id: "problem" });
const refused = element("div", { id: "refused" });
const phase = element("span", { class: "phase" });
const numbers = element("span", {});
const error = element("span", {});
const line = element("p", { class: "numbers-line", id: "numbers" }, phase, numbers, error);
const hint = element(
  "p",
  { class: "note" },
  "Drag to turn, with Shift or the middle button to move, with the right button or the wheel to come nearer. Files are watched.",
);

fill(
  document.getElementById("main"),
  element(
    "div",
    { class: "job" },
    element("div", { class: "left" }, problem, refused, element("section", { class: "viewer", "aria-label": "Picture" }, looked.root, line, hint)),
    element("div", { class: "right" }, chosen.root, found.root),
  ),
);
watchKeys();
onRefused((answer) => fill(refused, box(answer.title, answer.detail, "")));

function show(state) {
  document.body.dataset.phase = state.phase;
  write(phase, PHASES[state.phase] ?? state.phase);
  if (state.picture > 0) {
    const [width, height] = state.size;
    write(numbers, `${width} × ${height}, ${Number(state.samples.toFixed(1))} samples a pixel, ${state.seconds} s`);
    write(error, state.relmse ? `error (relMSE) ${brief(state.relmse[0])}, 95 %: ${brief(state.relmse[1])} to ${brief(state.relmse[2])}` : "error not known yet");
    document.body.dataset.samples = state.samples;
    void looked.show(state.picture);
    found.show(state.diagnostics.map((row) => ({ ...row, prim: row.prim_path, detail: row.message })));
  }
  chosen.show(state);
  showProblem(state.problem);
}

const brief = (number) => (Number.isFinite(number) ? number.toPrecision(2) : "?");

let shownText = "";

function showProblem(given) {
  const text = JSON.stringify(given);
  if (text === shownText) return;
  shownText = text;
  if (given) fill(problem, box("The stage cannot be rendered as it is now", `${given.code}: ${given.message}`, given.where));
  else fill(problem);
  fill(refused);
}

function box(title, detail, where) {
  return element(
    "section",
    { class: "problem", role: "alert" },
    element("h3", {}, title),
    detail && element("p", {}, detail),
    where && element("p", {}, element("code", {}, where)),
  );
}

const server = document.getElementById("server");
const events = new EventSource("events");
events.onmessage = (event) => {
  write(server, "");
  show(JSON.parse(event.data));
};
events.onerror = () => write(server, "primray view has ended, or does not answer");

stage().then(({ name }) => {
  write(document.getElementById("name"), name);
  document.title = `${name} · primray`;
});
