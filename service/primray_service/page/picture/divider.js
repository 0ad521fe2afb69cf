// The line between two pictures on a stage. It is on the stage, not on the sheet, so that it is one pixel wide at every zoom.

import { element } from "../base/dom.js";

export function divider(board, onMove) {
  const root = element("div", { class: "divider", hidden: true });
  let percent = 50;

  function show(isShown, at) {
    percent = at;
    root.hidden = !isShown;
    follow();
  }

  function follow() {
    const sheet = board.sheet.getBoundingClientRect();
    root.style.left = `${sheet.left - board.root.getBoundingClientRect().left + (sheet.width * percent) / 100}px`;
  }

  function drag(event) {
    event.stopPropagation();
    if (event.buttons !== 1 && event.type !== "pointerdown") return;
    const sheet = board.sheet.getBoundingClientRect();
    onMove(Math.min(100, Math.max(0, (100 * (event.clientX - sheet.left)) / sheet.width)));
  }

  root.addEventListener("pointerdown", (event) => {
    root.setPointerCapture(event.pointerId);
    drag(event);
  });
  root.addEventListener("pointermove", drag);
  const moved = new MutationObserver(follow);
  moved.observe(board.sheet, { attributeFilter: ["style"] });
  return { root, show, close: () => moved.disconnect() };
}
