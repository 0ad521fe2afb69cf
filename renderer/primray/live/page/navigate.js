// The mouse and keys that move the camera: drags are sent as fractions of the picture's height. A drag turns about what is under
// the mouse where it begins; a click names it, with Ctrl or Cmd it explains the pixel.

const KEY_STEP = 0.05;
const WHEEL_STEP = 0.0015; // for a pixel of a wheel
const STILL_PIXELS = 3; // a mouse that goes no further clicks
const KINDS = { 0: "tumble", 1: "pan", 2: "dolly" }; // by button
const FLIGHTS = { w: ["ahead", 1], s: ["ahead", -1], d: ["across", 1], a: ["across", -1], e: ["up", 1], q: ["up", -1] };
const FLIGHT_SPEED = 0.7; // parts of the distance to what is looked at, a second
const FASTER = 4; // with Shift

// `send` and `move` are a sender's (sender.js). `wheels(event)` says whether a turn of the wheel is meant for the camera.
export function navigate({ root, pointOf }, { send, move }, wheels = () => true) {
  watchMouse(root, pointOf, send, move);
  root.addEventListener("wheel", (event) => wheels(event) && onWheel(event, move), { passive: false });
  watchMoves(root, move);
  watchFlights(root, move);
}

function watchMouse(root, pointOf, send, move) {
  let drag = null;

  root.addEventListener("pointerdown", (event) => {
    const kind = kindOf(event);
    if (!kind) return;
    event.preventDefault();
    root.focus({ preventScroll: true });
    root.setPointerCapture(event.pointerId);
    drag = { kind, x: event.clientX, y: event.clientY, at: pointOf(event), moved: false };
  });
  root.addEventListener("pointermove", (event) => {
    if (!drag) return;
    const height = root.clientHeight || 1;
    const [x, y] = [event.clientX - drag.x, event.clientY - drag.y];
    if (!drag.moved && Math.hypot(x, y) <= STILL_PIXELS) return;
    if (!drag.moved && drag.at && drag.kind !== "look") send({ do: "pivot", ...drag.at });
    Object.assign(drag, { x: event.clientX, y: event.clientY, moved: true });
    const [across, down] = [x / height, y / height];
    if (drag.kind === "dolly") move("dolly", { steps: 2 * (across - down) });
    else move(drag.kind, { across, down });
  });
  root.addEventListener("pointerup", (event) => {
    const kind = event.ctrlKey || event.metaKey ? "explain" : "select";
    if (drag && !drag.moved && event.button === 0) send(drag.at ? { do: kind, ...drag.at } : { do: "deselect" });
    drag = null;
  });
  root.addEventListener("pointercancel", () => (drag = null));
  root.addEventListener("contextmenu", (event) => event.preventDefault());
}

function kindOf(event) {
  if (event.button !== 0) return KINDS[event.button];
  return event.altKey ? "look" : event.shiftKey ? "pan" : "tumble";
}

function onWheel(event, move) {
  event.preventDefault();
  const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
  move("dolly", { steps: -Math.max(-500, Math.min(500, pixels)) * WHEEL_STEP });
}

function watchMoves(root, move) {
  root.addEventListener("keydown", (event) => {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const nearer = { "+": 1, "=": 1, "-": -1 }[event.key];
    if (event.ctrlKey || event.metaKey || !(arrows || nearer)) return;
    event.preventDefault();
    if (nearer) return void move("dolly", { steps: 2 * nearer * KEY_STEP });
    const kind = event.altKey ? "look" : event.shiftKey ? "pan" : "tumble";
    move(kind, { across: arrows[0] * KEY_STEP, down: arrows[1] * KEY_STEP });
  });
}

// A key that is held flies on, at a speed that does not depend on how often it repeats.
function watchFlights(root, move) {
  const held = new Set();
  let fast = false;
  let before = 0;

  function fly(now) {
    if (held.size === 0) return;
    const seconds = Math.min(now - before, 100) / 1000;
    before = now;
    const amounts = { ahead: 0, across: 0, up: 0 };
    for (const key of held) amounts[FLIGHTS[key][0]] += FLIGHTS[key][1] * FLIGHT_SPEED * seconds * (fast ? FASTER : 1);
    if (Object.values(amounts).some((amount) => amount !== 0)) move("fly", amounts);
    requestAnimationFrame(fly);
  }

  root.addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    if (event.ctrlKey || event.metaKey || event.altKey || !FLIGHTS[key]) return;
    event.preventDefault();
    fast = event.shiftKey;
    if (held.size === 0) {
      before = performance.now() - 16;
      requestAnimationFrame(fly);
    }
    held.add(key);
  });
  root.addEventListener("keyup", (event) => {
    fast = event.shiftKey;
    held.delete(event.key.toLowerCase());
  });
  root.addEventListener("blur", () => held.clear());
}

// These keys work wherever the focus is below `root`, except in controls for text and choices.
export function watchKeys(root, { send }, play = () => {}) {
  root.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest?.("input, select, textarea")) return;
    if (event.key === "f") send({ do: "frame" });
    if (event.key === "r") send({ do: "reset" });
    if (event.key === "p") play();
    if (event.key === "Escape") send({ do: "deselect" });
  });
}

// Where an event is in a canvas whose picture fits into its box, from its upper left corner, in 0 to 1; null beside it.
export function pointIn(canvas, event) {
  const box = canvas.getBoundingClientRect();
  const scale = Math.min(box.width / canvas.width, box.height / canvas.height);
  const x = 0.5 + (event.clientX - box.x - box.width / 2) / (scale * canvas.width);
  const y = 0.5 + (event.clientY - box.y - box.height / 2) / (scale * canvas.height);
  return x >= 0 && x <= 1 && y >= 0 && y <= 1 ? { x, y } : null;
}
