// A form for one operation of an OpenAPI document, and the request that it makes: address, headers, body.

import { button, choice, element, field, fill } from "../base/dom.js";

const ANY_SCENE = /sha256:0{64}/g; // the placeholder in examples of bodies

// `known` has values of parameters from earlier answers; `run` is called with { url, method, headers, body }.
export function requestForm(spec, method, path, operation, known, run) {
  const parameters = (operation.parameters ?? []).map((parameter) => ({ ...parameter, control: controlOf(parameter) }));
  const bodies = Object.entries(operation.requestBody?.content ?? {});
  const kinds = Object.keys(Object.values(operation.responses)[0].content ?? {});
  const kind = bodies.length > 1 ? choice(bodies.map(([name]) => [name, name])) : null;
  const accept = kinds.length > 1 ? choice(kinds.map((name) => [name, name]), kinds.find((name) => name === "application/json")) : null;
  const place = element("div", { class: "body" });
  let body = null;
  const chooseBody = () => {
    const [name, media] = bodies.find(([name]) => name === (kind?.value ?? bodies[0][0]));
    body = bodyOf(spec, name, media, operation.requestBody.required);
    fill(place, body.fields);
    fillKnown();
  };
  const fillKnown = () => {
    for (const { name, control } of parameters) if (!control.value && known.has(name)) control.value = known.get(name);
    if (body?.text && known.has("scene_id")) body.text.value = body.text.value.replaceAll(ANY_SCENE, known.get("scene_id"));
  };
  kind?.addEventListener("change", chooseBody);
  document.addEventListener("known", fillKnown);

  const sent = element("button", { class: "main" }, "Send");
  const stop = button("Stop", () => stop.controller?.abort(), { hidden: true });
  const root = element(
    "form",
    { "aria-label": `Try ${method} ${path}` },
    parameters.map(({ name, control, ...one }) => field(`${name} (${one.in}${one.required ? ", required" : ""})`, control, one.description)),
    kind && field("Kind of body", kind),
    accept && field("Answer as", accept),
    place,
    element("div", { class: "actions" }, sent, stop),
  );
  root.addEventListener("submit", (event) => {
    event.preventDefault();
    const headers = { ...(accept && { accept: accept.value }), ...body?.headers() };
    run({ method, headers, body: body?.content(), url: addressed(path, parameters, headers) });
  });
  if (bodies.length > 0) chooseBody();
  else fillKnown();

  return {
    root,
    busy(controller) {
      stop.controller = controller;
      stop.hidden = controller === null;
      sent.disabled = controller !== null;
    },
  };
}

// Returns the path and query of the address; header parameters are added to `headers`.
function addressed(path, parameters, headers) {
  const query = new URLSearchParams();
  let filled = path;
  for (const { name, in: where, schema, control } of parameters) {
    if (where === "path") filled = filled.replace(`{${name}}`, encodeURIComponent(control.value.trim()));
    else if (control.value === "") continue;
    else if (where === "header") headers[name] = control.value;
    else for (const value of isArray(schema) ? control.value.split(/\s*,\s*/) : [control.value]) query.append(name, value);
  }
  return `${filled}${query.size > 0 ? `?${query}` : ""}`;
}

const isArray = (schema) => schema.type === "array" || schema.anyOf?.some(({ type }) => type === "array");

function controlOf({ schema, required }) {
  const defaultText = schema.default === undefined || schema.default === null ? "" : `default: ${schema.default}`;
  const values = schema.enum ?? schema.anyOf?.find((one) => one.enum)?.enum ?? (schema.type === "boolean" ? [true, false] : null);
  if (values) return choice([...(required ? [] : [["", defaultText || "not sent"]]), ...values.map((value) => [value, value])]);
  const placeholder = isArray(schema) ? "separated by commas" : defaultText || (schema.examples?.[0] ?? "");
  return element("input", { type: "text", required, placeholder, autocomplete: "off", spellcheck: "false" });
}

// Returns the controls of a body, and functions that read a request's body and headers from them.
function bodyOf(spec, name, media, required) {
  if (name === "application/json") {
    const text = element("textarea", { spellcheck: "false", required, value: JSON.stringify(media.example ?? {}, null, 2) });
    const content = () => text.value.trim() || undefined;
    return { fields: [field("Body", text)], text, content, headers: () => (content() ? { "content-type": name } : {}) };
  }
  if (name !== "multipart/form-data") {
    const file = element("input", { type: "file", required: true });
    return { fields: [field("File", file)], content: () => file.files[0], headers: () => ({ "content-type": name }) };
  }
  const parts = Object.entries(media.schema.properties).map(([part, schema]) => {
    const isFile = schema.format === "binary";
    const wanted = media.schema.required?.includes(part);
    const control = isFile
      ? element("input", { type: "file", required: wanted })
      : element("textarea", { spellcheck: "false", value: JSON.stringify(exampleOf(spec, schema), null, 2) });
    return { part, control, value: () => (isFile ? control.files[0] : control.value.trim()) };
  });
  const content = () => {
    const form = new FormData();
    for (const { part, value } of parts) if (value()) form.append(part, value());
    return form;
  };
  return { fields: parts.map(({ part, control }) => field(part, control)), content, headers: () => ({}) };
}

function exampleOf(spec, schema) {
  const named = schema.$ref ? spec.components.schemas[schema.$ref.split("/").pop()] : schema;
  return named.examples?.[0] ?? named.example ?? {};
}
