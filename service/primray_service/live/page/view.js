// The page of `primray view`: a picture that follows mouse, files and choices, and its state. The server does the work: it
// sends its state as events; the page fetches the picture that a state names and sends the user's actions.

import { diagnostics } from "../page/base/diagnostics.js";
import { element, fill, write } from "../page/base/dom.js";
import { navigate, watchKeys } from "../page/live/navigate.js";
import { cameraPanel } from "./camera_panel.js";
import { explainedPanel } from "./explained_panel.js";
import { lightPanel } from "./light_panel.js";
import { lookPanel } from "./look_panel.js";
import { mixPanel } from "./mix_panel.js";
import { picture } from "./picture.js";
import { commands, onRefused, stage } from "./server.js";
import { status } from "./status.js";
import { takeAway } from "./take_away.js";

const line = status();
const looked = picture(line.step);
const camera = cameraPanel();
const panels = [camera, explainedPanel(), lookPanel(), mixPanel(), lightPanel()];
const found = diagnostics();
const problem = element("div", { id: "problem" });
const refused = element("div", { id: "refused" });
const hint = element(
  "p",
  { class: "note" },
  "Drag to turn about what is under the mouse, with Shift or the middle button to move, with Alt to look around, with the right " +
    "button or the wheel to come nearer. W, A, S, D, Q and E fly. Click to name what is there, with Ctrl to see what the pixel's light is made of. Files are watched.",
);

fill(
  document.getElementById("main"),
  element(
    "div",
    { class: "job" },
    element("div", { class: "left" }, problem, refused, element("section", { class: "viewer", "aria-label": "Picture" }, looked.root, line.root, hint)),
    element("div", { class: "right" }, panels.map((panel) => panel.root), takeAway().root, found.root),
  ),
);
navigate(looked, commands);
watchKeys(document, commands, camera.play);
onRefused((answer) => fill(refused, box(answer.title, answer.detail, "")));

function show(state) {
  document.body.dataset.phase = state.phase;
  line.show(state);
  if (state.picture > 0) {
    document.body.dataset.samples = state.samples;
    void looked.show(state.picture);
    found.show(state.diagnostics.map((row) => ({ ...row, prim: row.prim_path, detail: row.message })));
  }
  for (const panel of panels) panel.show(state);
  showProblem(state.problem);
}

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
