// A stage on which a picture can be zoomed and moved by wheel, drag, pinch, buttons and keys. It knows sizes and pixels, not
// the content. Its sheet has the picture's size in CSS pixels and is positioned by a transform.

import { button, element, say, write } from "../base/dom.js";

const MOST_ZOOM = 64;
const STEP = 1.25;
const SCROLLING_MS = 400; // a page that is being scrolled by the wheel keeps scrolling when the picture comes under the pointer
const KEYS = "plus and minus zoom, 0 fits, 1 shows pixel for pixel, arrows move, Shift with arrows picks a pixel";

// `keys` is {words, press}: a description of other keys, and `press(key)`, which returns whether it handled the key. `onAsk` is
// called with a pixel that is clicked with Ctrl, or picked by keys and entered.
export function stage(label, { onPixel = () => {}, onAsk = null, keys = { words: "", press: () => false } } = {}) {
  const mark = element("div", { class: "mark", hidden: true });
  const sheet = element("div", { class: "sheet" }, mark);
  const root = element("div", { class: "stage", tabindex: "0", role: "application", "aria-roledescription": "picture", "aria-label": `${label}. Keys: ${[KEYS, keys.words].filter(Boolean).join("; ")}` }, sheet);
  const zoomText = element("output", { class: "zoom-text" });
  let [width, height] = [0, 0];
  let [scale, left, top] = [1, 0, 0];
  let [fitted, filling] = [true, false]; // whether it is positioned automatically; whether small pictures are enlarged then
  let picked = null; // the pixel chosen by keys
  const pointers = new Map();

  function size(w, h) {
    if (w === width && h === height) return;
    [width, height] = [w, h];
    sheet.style.width = `${w}px`;
    sheet.style.height = `${h}px`;
    root.style.setProperty("--aspect", `${w} / ${h}`);
    root.style.setProperty("--natural", `${h}px`);
    picked = null;
    mark.hidden = true;
    fit(filling);
  }

  // At first no picture is enlarged.
  function fit(fills) {
    [fitted, filling] = [true, fills];
    if (!width || !root.clientWidth) return;
    scale = Math.min(root.clientWidth / width, root.clientHeight / height);
    if (!fills) scale = Math.min(1, scale);
    // A small picture is enlarged by a whole number, so that its pixels stay square.
    else if (scale > 2) scale = Math.floor(scale);
    left = (root.clientWidth - width * scale) / 2;
    top = (root.clientHeight - height * scale) / 2;
    place();
  }

  function place() {
    sheet.style.transform = `translate(${left}px, ${top}px) scale(${scale})`;
    sheet.classList.toggle("pixelated", scale * devicePixelRatio >= 2);
    root.classList.toggle("moved", !fitted);
    sheet.style.setProperty("--scale", String(scale));
    write(zoomText, width ? `${Math.round(100 * scale)} %` : "");
  }

  // Keeps the point (x, y) of the stage in place.
  function zoom(factor, x = root.clientWidth / 2, y = root.clientHeight / 2) {
    if (!width) return;
    const least = Math.min(1, root.clientWidth / width, root.clientHeight / height) / 2;
    const next = Math.min(MOST_ZOOM, Math.max(least, scale * factor));
    left = x - ((x - left) * next) / scale;
    top = y - ((y - top) * next) / scale;
    scale = next;
    fitted = false;
    keepInSight();
  }

  function move(dx, dy) {
    left += dx;
    top += dy;
    fitted = false;
    keepInSight();
  }

  function keepInSight() {
    const margin = 40;
    left = Math.min(root.clientWidth - margin, Math.max(margin - width * scale, left));
    top = Math.min(root.clientHeight - margin, Math.max(margin - height * scale, top));
    place();
  }

  function pixelAt(clientX, clientY) {
    const box = root.getBoundingClientRect();
    const x = Math.floor((clientX - box.left - left) / scale);
    const y = Math.floor((clientY - box.top - top) / scale);
    return x >= 0 && y >= 0 && x < width && y < height ? [x, y] : null;
  }

  function pick(dx, dy) {
    if (!width) return;
    const [x, y] = picked ?? [Math.floor(width / 2), Math.floor(height / 2)];
    const words = pickAt([Math.min(width - 1, Math.max(0, x + dx)), Math.min(height - 1, Math.max(0, y + dy))]);
    if (words) say(words);
  }

  function pickAt(at) {
    picked = at;
    mark.hidden = false;
    mark.style.left = `${at[0]}px`;
    mark.style.top = `${at[1]}px`;
    return onPixel(at);
  }

  // Returns whether the click asks about a pixel.
  function asks(event) {
    if (!onAsk || !(event.ctrlKey || event.metaKey)) return false;
    const at = pixelAt(event.clientX, event.clientY);
    if (at) {
      pickAt(at);
      onAsk(at);
    }
    return true;
  }

  const actual = () => {
    zoom(1 / (scale * devicePixelRatio));
  };

  root.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target !== root) return;
    if (keys.press(event.key)) {
      event.preventDefault();
      return;
    }
    const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (arrow && event.shiftKey) pick(...arrow);
    else if (arrow) move(-40 * arrow[0], -40 * arrow[1]);
    else if (event.key === "+" || event.key === "=") zoom(STEP);
    else if (event.key === "-") zoom(1 / STEP);
    else if (event.key === "0") fit(true);
    else if (event.key === "1") actual();
    else if (event.key === "Escape" && !mark.hidden) {
      mark.hidden = true;
      picked = null;
      onPixel(null);
    } else if (event.key === "Enter" && onAsk && picked) onAsk(picked);
    else return;
    event.preventDefault();
  });
  let scrolledAt = -SCROLLING_MS;
  const elsewhere = (event) => {
    if (!root.contains(event.target)) scrolledAt = event.timeStamp;
  };
  addEventListener("wheel", elsewhere, { passive: true });
  root.addEventListener(
    "wheel",
    (event) => {
      if (event.timeStamp - scrolledAt < SCROLLING_MS) {
        scrolledAt = event.timeStamp;
        return;
      }
      event.preventDefault();
      const box = root.getBoundingClientRect();
      zoom(STEP ** (-Math.sign(event.deltaY)), event.clientX - box.left, event.clientY - box.top);
    },
    { passive: false },
  );
  root.addEventListener("dblclick", (event) => {
    if (onAsk && (event.ctrlKey || event.metaKey)) return;
    const box = root.getBoundingClientRect();
    if (fitted) zoom(Math.max(2, 1 / (scale * devicePixelRatio)), event.clientX - box.left, event.clientY - box.top);
    else fit(true);
  });
  root.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || asks(event)) return;
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    root.setPointerCapture(event.pointerId);
  });
  root.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (before) {
      const after = [event.clientX, event.clientY];
      const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
      if (other) pinch(before, after, other);
      else if (event.pointerType === "mouse" || !fitted) move(after[0] - before[0], after[1] - before[1]);
      pointers.set(event.pointerId, after);
    }
    if (event.pointerType === "mouse" || before) onPixel(pixelAt(event.clientX, event.clientY));
  });
  for (const end of ["pointerup", "pointercancel"]) root.addEventListener(end, (event) => pointers.delete(event.pointerId));
  root.addEventListener("pointerleave", () => onPixel(picked));

  function pinch(before, after, other) {
    const box = root.getBoundingClientRect();
    const distance = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]) || 1;
    zoom(distance(after) / distance(before), other[0] - box.left, other[1] - box.top);
  }

  const sized = new ResizeObserver(() => (fitted ? fit(filling) : place()));
  sized.observe(root);

  const tools = element(
    "div",
    { class: "tools", role: "group", "aria-label": "On the picture" },
    button("−", () => zoom(1 / STEP), { "aria-label": "Zoom out" }),
    zoomText,
    button("+", () => zoom(STEP), { "aria-label": "Zoom in" }),
    button("Fit", () => fit(true)),
    button("1:1", actual, { "aria-label": "Pixel for pixel" }),
  );
  function close() {
    sized.disconnect();
    removeEventListener("wheel", elsewhere);
  }

  return { root, sheet, tools, size, fit, close };
}
