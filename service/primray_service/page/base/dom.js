// Elements made from data. Text becomes text nodes only, so that nothing in a scene, a label or an answer of the server can
// become markup; attributes that could run scripts are refused.

const REFUSED = /^(on|style$|srcdoc$)/i;

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name === "on") for (const [event, run] of Object.entries(value)) made.addEventListener(event, run);
    else if (name === "data") Object.assign(made.dataset, value);
    else if (name === "value") made.value = value;
    else if (REFUSED.test(name)) throw new Error(`${name} is not set by data`);
    else made.setAttribute(name, value === true ? "" : String(value));
  }
  made.append(...present(children));
  return made;
}

export function fill(parent, ...children) {
  parent.replaceChildren(...present(children));
  return parent;
}

function present(children) {
  return children.flat(3).filter((child) => child !== undefined && child !== null && child !== false).map(asNode);
}

const asNode = (child) => (child instanceof Node ? child : document.createTextNode(String(child)));

// Text is set only if it differs: a screen reader repeats text that is set again, and a selection in it is lost.
export function write(node, text) {
  if (node.textContent !== String(text)) node.textContent = String(text);
}

export function button(label, run, attributes = {}) {
  return element("button", { type: "button", ...attributes, on: { click: run } }, label);
}

let made = 0;

export const freshId = (word) => `${word}-${++made}`;

// A control under its label, with an explanation.
export function field(label, control, hint) {
  control.id ||= freshId("field");
  const explained = hint ? element("small", { id: `${control.id}-hint` }, hint) : null;
  if (explained) control.setAttribute("aria-describedby", explained.id);
  return element("div", { class: "field" }, element("label", { for: control.id }, label), control, explained);
}

// A control whose name is not visible, because its position makes it clear.
export function labelled(name, control) {
  control.setAttribute("aria-label", name);
  return control;
}

// A checkbox before its name.
export function ticked(name, control, meaning = "") {
  control.id ||= freshId("tick");
  return element("div", { class: "tick", title: meaning || null }, control, element("label", { for: control.id }, name));
}

export function choice(options, chosen, attributes = {}) {
  const made = element("select", attributes, options.map(([value, text]) => element("option", { value }, text)));
  if (chosen !== undefined && chosen !== null) made.value = chosen;
  return made;
}

// Announces changes of the picture to screen readers.
export function say(text) {
  write(document.getElementById("say"), text);
}
