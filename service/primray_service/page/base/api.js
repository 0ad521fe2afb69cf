// Calls the service: JSON in and out, uploads with progress. Each failure becomes a Failure with a problem document.

export class Failure extends Error {
  constructor(problem, retryAfter = null) {
    super(problem.detail || problem.title);
    this.problem = problem;
    this.retryAfter = retryAfter; // seconds
  }
}

export const keyNeeded = Object.assign(new EventTarget(), { since: 0 }); // "needed" is dispatched when an answer says that a key is missing

const silence = (detail) =>
  new Failure({ type: "/problems/no-answer", title: "The server does not answer", status: 0, detail, retryable: true });

export async function call(method, path, { json, headers = {}, signal, accept = "application/json" } = {}) {
  const request = { method, signal, headers: { accept, ...headers }, credentials: "same-origin", cache: "no-cache" };
  if (json !== undefined) {
    request.body = JSON.stringify(json);
    request.headers["content-type"] = "application/json";
  }
  const began = performance.now();
  let response;
  try {
    response = await fetch(path, request);
  } catch (reason) {
    if (signal?.aborted) throw reason;
    throw silence("The request did not reach it, or its answer was lost.");
  }
  if (response.ok) return response;
  throw failureOf(response.status, await response.text(), response.headers.get("retry-after"), began);
}

function failureOf(status, text, retryAfter, began = performance.now()) {
  let problem;
  try {
    problem = JSON.parse(text);
  } catch {
    problem = null;
  }
  if (typeof problem?.title !== "string") {
    problem = { type: "", title: `The server answered with status ${status}`, status, detail: text.slice(0, 300) };
  }
  // Ignore answers to requests from before the key was entered.
  if (status === 401 && began >= keyNeeded.since) keyNeeded.dispatchEvent(new CustomEvent("needed", { detail: problem }));
  return new Failure(problem, retryAfter && /^\d+$/.test(retryAfter) ? Number(retryAfter) : null);
}

export async function get(path, options) {
  return (await call("GET", path, options)).json();
}

export async function send(method, path, json, headers) {
  const response = await call(method, path, { json, headers });
  return response.status === 204 ? null : response.json();
}

// A repeated request with the same token must not create a second job; randomUUID is missing on pages that came over plain
// http.
export function token() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

export const jobPath = (id, rest = "") => `/v1/jobs/${encodeURIComponent(id)}${rest}`;
export const scenePath = (id) => `/v1/scenes/${encodeURIComponent(id)}`;

// In bytes. Smaller files are sent faster than the server can be asked for them; digest() needs the whole file in memory.
const [HASHED_AT_LEAST, HASHED_AT_MOST] = [2 ** 23, 2 ** 28];

// Returns the scene of these bytes if the server has it already: then nothing is sent.
export async function known(blob) {
  if (!globalThis.crypto?.subtle || blob.size < HASHED_AT_LEAST || blob.size > HASHED_AT_MOST) return null;
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", await blob.arrayBuffer()));
  const id = `sha256:${[...digest].map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
  try {
    return await get(scenePath(id));
  } catch (failure) {
    if (failure.problem?.status === 404) return null;
    throw failure;
  }
}

// XMLHttpRequest is used because fetch reports no progress of a request's body.
export function upload(blob, name, onProgress, signal) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", `/v1/scenes?name=${encodeURIComponent(name)}`);
    request.responseType = "text";
    request.setRequestHeader("accept", "application/json");
    request.setRequestHeader("content-type", mediaType(name));
    request.upload.addEventListener("progress", (event) => onProgress(event.loaded, blob.size));
    request.addEventListener("load", () => {
      if (request.status >= 200 && request.status < 300) resolve(JSON.parse(request.responseText));
      else reject(failureOf(request.status, request.responseText, request.getResponseHeader("retry-after")));
    });
    request.addEventListener("error", () => reject(silence("The upload broke off.")));
    request.addEventListener("abort", () => reject(new DOMException("The upload was stopped.", "AbortError")));
    signal?.addEventListener("abort", () => request.abort());
    request.send(blob);
  });
}

const MEDIA_TYPES = { usda: "model/vnd.usda", usdz: "model/vnd.usdz+zip", zip: "application/zip" };

const mediaType = (name) => MEDIA_TYPES[name.split(".").pop().toLowerCase()] ?? "application/octet-stream";
