// Shows a server's answer: status, headers, and the body as JSON, text as it arrives, a picture, or a file to save.

import { element } from "../base/dom.js";

const SHOWN_AT_MOST = 200_000; // characters

// Returns the body if it is JSON, once it has arrived.
export async function showAnswer(root, response, milliseconds) {
  root.dataset.class = String(response.status)[0];
  root.append(
    element("h4", {}, `${response.status} ${response.statusText}`, ` · ${Math.round(milliseconds)} ms`),
    element("details", {}, element("summary", {}, "Headers"), element("pre", {}, [...response.headers].map((pair) => pair.join(": ")).join("\n"))),
  );
  const kind = response.headers.get("content-type") ?? "";
  if (/json/.test(kind)) {
    const text = await response.text();
    const found = parsed(text);
    root.append(element("pre", { class: "content" }, cut(found === undefined ? text : JSON.stringify(found, null, 2))));
    return found;
  }
  if (kind.startsWith("text/")) {
    await stream(response, root);
  } else if (kind) {
    showFile(root, await response.blob(), kind);
  } else {
    root.append(element("p", { class: "soft" }, "No body."));
  }
  return undefined;
}

export function showFailure(root, words) {
  root.dataset.class = "0";
  root.append(element("h4", {}, words));
}

// Events arrive one by one until the job ends or Stop is pressed.
async function stream(response, root) {
  const shown = element("pre", { class: "content" });
  root.append(shown);
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    if (shown.textContent.length < SHOWN_AT_MOST) shown.append(part.value);
  }
}

function showFile(root, blob, kind) {
  const url = URL.createObjectURL(blob);
  if (kind.startsWith("image/") && !/exr/.test(kind)) root.append(element("img", { src: url, alt: "The picture that was answered" }));
  root.append(element("a", { href: url, download: "answer" }, `Save ${blob.size} bytes (${kind})`));
}

function parsed(text) {
  try {
    return JSON.parse(text);
  } catch {
    return undefined;
  }
}

const cut = (text) => (text.length > SHOWN_AT_MOST ? `${text.slice(0, SHOWN_AT_MOST)}\n...` : text);
