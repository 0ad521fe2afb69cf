// Light that the stage has not: a dome of a file, the studio light; and what is behind.

import { choice, element, field, ticked, write } from "../page/base/dom.js";
import { send } from "./server.js";

const set = (name, value) => send({ do: "set", [name]: value });

export function lightPanel() {
  const studio = choice(
    [
      ["auto", "where nothing else lights the stage"],
      ["on", "on"],
      ["off", "off"],
    ],
    "auto",
  );
  studio.addEventListener("change", () => set("studio_light", studio.value));
  const dome = element("input", { type: "text", spellcheck: "false", placeholder: "the stage's own" });
  dome.addEventListener("change", () => set("dome", dome.value.trim() || null));
  const degrees = element("output", {});
  const rotation = element("input", { type: "range", min: -180, max: 180, step: 1, value: "0" });
  rotation.addEventListener("input", () => {
    write(degrees, `${rotation.value}°`);
    set("dome_rotation", Number(rotation.value));
  });
  const visible = element("input", { type: "checkbox" });
  visible.addEventListener("change", () => set("dome_visible", visible.checked));
  const background = choice(
    [
      ["", "as the stage has it"],
      ["transparent", "transparent"],
      ["color", "a colour"],
    ],
    "",
  );
  const color = element("input", { type: "color", value: "#808080", "aria-label": "Colour of the background", hidden: true });
  const changeBackground = () => set("background", background.value === "color" ? color.value : background.value || null);
  background.addEventListener("change", changeBackground);
  color.addEventListener("change", changeBackground);

  const root = element(
    "details",
    { class: "card" },
    element("summary", {}, "Light and background"),
    element(
      "div",
      { class: "controls" },
      field("Studio light", studio),
      field("Dome, a lat-long image on this machine", dome),
      element("div", { class: "field exposure" }, field("Dome's rotation", rotation), degrees),
      ticked("Show domes in the picture", visible),
      field("Background", background),
      color,
    ),
  );

  function show({ set: now }) {
    if (!now) return;
    const keep = (control, change) => document.activeElement !== control && change();
    keep(studio, () => (studio.value = now.studio_light));
    keep(dome, () => (dome.value = now.dome ?? ""));
    keep(rotation, () => {
      rotation.value = now.dome_rotation;
      write(degrees, `${Number(now.dome_rotation)}°`);
    });
    visible.checked = now.dome_visible;
    keep(background, () => (background.value = now.background?.startsWith("#") ? "color" : (now.background ?? "")));
    if (now.background?.startsWith("#")) keep(color, () => (color.value = now.background));
    color.hidden = background.value !== "color";
  }

  return { root, show };
}
