// The camera: which one, at which time, what is selected; and the stage's variants.

import { button, choice, element, field, fill, say, write } from "../page/base/dom.js";
import { selectedWords } from "../page/live/figures.js";
import { keepFocus } from "./focus.js";
import { send, sendAndSee } from "./server.js";

const FEW = 4; // variants that are shown unfolded

export function cameraPanel() {
  const camera = element("div", {});
  const time = timeSlider();
  const selected = element("p", { class: "selected", id: "selected" });
  const variants = element("div", { class: "controls" });
  const many = element("summary", {});
  const folded = element("details", { hidden: true }, many, variants);
  const frame = button(["Frame ", element("span", {}, "all"), " ", element("kbd", {}, "f")], () => send({ do: "frame" }));
  const root = element(
    "section",
    { class: "card controls", "aria-label": "What is looked at" },
    camera,
    time.root,
    selected,
    element("div", { class: "actions" }, frame, button(["Reset ", element("kbd", {}, "r")], () => send({ do: "reset" }))),
    folded,
  );
  let drawn = "";
  let known = false;
  let named = null;

  function show(state) {
    time.show(state);
    showSelected(state.selected);
    const text = JSON.stringify([state.cameras, state.camera, state.moved, state.variants]);
    if (text === drawn) return;
    drawn = text;
    keepFocus(root, () => {
      fill(camera, cameraField(state));
      fill(variants, (state.variants ?? []).map(variantField));
    });
    const count = state.variants?.length ?? 0;
    folded.hidden = count === 0;
    write(many, count === 1 ? "Variant" : `${count} variants`);
    if (!known) folded.open = count <= FEW;
    known = known || count > 0;
  }

  function showSelected(found) {
    const text = JSON.stringify(found ?? null);
    if (text === named) return;
    const isFirst = named === null;
    named = text;
    write(frame.querySelector("span"), found ? "selected" : "all");
    if (found) {
      fill(selected, element("code", {}, found.prim), " ", element("span", { class: "note" }, selectedWords(found)));
      say(`Selected ${found.prim}`);
    } else {
      fill(selected, element("span", { class: "note" }, "Nothing is selected: click something to name it."));
      if (!isFirst) say("Nothing is selected");
    }
  }

  return { root, show, play: time.play };
}

// Frames are played at the stage's rate: each picture is that of the frame which is due by then, and at least the next one, so
// that slow stages leave frames out. A picture is waited for before the next is asked for.
function timeSlider() {
  const shown = element("output", {});
  const slider = element("input", { type: "range", step: 1 });
  const playing = button([element("span", {}, "Play"), " ", element("kbd", {}, "p")], play, { "aria-pressed": "false" });
  const root = element(
    "div",
    { hidden: true },
    element("div", { class: "field exposure" }, field("Frame", slider), shown),
    element("div", { class: "actions" }, playing),
  );
  let rate = 24;
  let round = 0; // of playing; 0: it rests
  let rounds = 0;

  slider.addEventListener("input", () => {
    rest();
    write(shown, slider.value);
    send({ do: "set", time_code: Number(slider.value) });
  });

  function play() {
    if (root.hidden) return;
    if (round) {
      rest();
      return;
    }
    round = ++rounds;
    write(playing.querySelector("span"), "Pause");
    playing.setAttribute("aria-pressed", "true");
    void playOn(round);
  }

  function rest() {
    round = 0;
    write(playing.querySelector("span"), "Play");
    playing.setAttribute("aria-pressed", "false");
  }

  async function playOn(mine) {
    const [first, end] = [Number(slider.min), Number(slider.max)];
    const count = Math.floor(end - first) + 1;
    const from = Math.floor(Number(slider.value) - first);
    const began = performance.now();
    let frame = 0; // since playing began
    while (round === mine) {
      frame = Math.max(frame + 1, Math.floor(((performance.now() - began) / 1000) * rate));
      const time = first + ((from + frame) % count);
      slider.value = time;
      write(shown, time);
      await sendAndSee({ do: "set", time_code: time });
    }
  }

  function show({ times, rate: given, set }) {
    root.hidden = !times;
    if (!times) rest();
    if (given) rate = given;
    if (!times || round || document.activeElement === slider) return;
    [slider.min, slider.max] = times;
    const now = set.time_code;
    slider.value = now ?? times[0];
    write(shown, now ?? "none");
  }

  return { root, show, play };
}

function cameraField(state) {
  const own = state.cameras?.includes(state.camera) ? [] : [["", "made for the stage"]];
  const options = [...own, ...(state.cameras ?? []).map((path) => [path, path])];
  const select = choice(options, state.camera ?? "", { "data-key": "camera" });
  select.addEventListener("change", () => send({ do: "camera", path: select.value || null }));
  return field("Camera", select, state.moved ? "moved; its lens is used" : undefined);
}

function variantField(variant) {
  const names = variant.names.map((name) => [name, name]);
  const options = variant.selection ? names : [["", "none"], ...names];
  const select = choice(options, variant.selection, { "data-key": `${variant.prim} ${variant.set}` });
  select.addEventListener("change", () => send({ do: "variant", prim: variant.prim, set: variant.set, name: select.value }));
  return field(`${variant.set} of ${variant.prim}`, select);
}
