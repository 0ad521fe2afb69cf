// The service's states, phases and problems in plain words, and advice on each problem.

import * as format from "./format.js";

export const STATES = {
  queued: "waiting for its turn",
  preparing: "getting ready",
  running: "rendering",
  pausing: "pausing",
  paused: "paused",
  canceling: "stopping",
  succeeded: "finished",
  failed: "failed",
  canceled: "cancelled",
  expired: "expired",
};

export const TERMINAL = new Set(["succeeded", "failed", "canceled", "expired"]);

const PHASES = {
  checking: "checking the scene",
  starting: "starting a renderer",
  opening: "opening the stage",
  translating: "reading prims, materials and lights",
  building: "building acceleration structures",
  sampling: "taking samples",
  writing: "writing the pictures",
};

export const stateWords = (state) => STATES[state] ?? state;

// "waiting for its turn: 2nd of 5, starts in about 0:34"
function placeWords(queue) {
  if (!queue?.place) return stateWords("queued");
  const start = queue.estimated_start_s;
  const when = start === null ? "start not known yet" : start < 1 ? "starts now" : `starts in about ${format.duration(start)}`;
  return `${stateWords("queued")}: place ${queue.place} of ${queue.waiting}, ${when}`;
}

export function phaseWords(job) {
  const phase = job.progress?.phase;
  if (job.state === "queued") return placeWords(job.queue);
  if (TERMINAL.has(job.state) || ["canceling", "pausing", "paused"].includes(job.state)) return stateWords(job.state);
  return PHASES[phase] ?? phase ?? stateWords(job.state);
}

// Errors of a picture in an artist's terms; a relMSE of 0.01 is noise of about a tenth of a pixel's value.
export const QUALITIES = [
  ["0.01", "Noise you can see", "for look-dev; error 0.01"],
  ["0.001", "Clean", "little noise left; error 0.001"],
  ["0.0001", "Reference", "to compare with; error 0.0001"],
];

export const STOPPED = {
  "target-error": "the target error was reached",
  "time-limit": "the time was used up",
  samples: "all samples were taken",
  interrupted: "it was stopped",
};

const ADVICE = {
  "invalid-request": "Correct the setting named above and try again.",
  "not-found": "It may have been deleted, or it belongs to another key. Look in the job list.",
  conflict: "Its state changed meanwhile. Look at it again, then try again.",
  "scene-in-use": "Cancel or delete the jobs that use it first.",
  "digest-mismatch": "The file was damaged on its way. Upload it again.",
  "upload-too-large": "Remove what the shot does not need, or ask the operator for a higher limit.",
  "upload-incomplete": "The connection broke. Upload it again.",
  "limit-exceeded": "Reduce it, or ask the operator for a higher limit.",
  "unsupported-setting": "Choose another value.",
  "parallel-denoise": "Leave out the denoised error to stop at, or parallel.",
  "parallel-adaptive": "Leave out adaptive sampling, or parallel.",
  unauthenticated: "Enter a valid API key.",
  forbidden: "Use a key that is allowed to do this.",
  "too-many-requests": "Wait a moment, then try again.",
  "quota-exceeded": "Wait until running jobs end, or delete jobs and scenes that are not needed.",
  "not-usd": "Upload a .usda, .usdc or .usdz file, or a zip or folder that holds the root layer and its assets.",
  "ambiguous-entry": "Choose one of the root layers that were found.",
  "entry-missing": "Choose one of the package's root layers.",
  "package-unsafe": "Remove or rename the member named above and pack it again.",
  "package-too-large": "Remove what the shot does not need.",
  "asset-path-outside-job": "Upload the folder that holds the scene and all it refers to, and make its paths relative.",
  "asset-missing": "Upload the folder that holds the scene together with this file.",
  "layer-unreadable": "Correct the layer at the place named above, and upload it again.",
  "scene-rejected": "Correct the scene and upload it again.",
  "scene-too-large": "Make the scene smaller, or ask the operator for a higher limit.",
  "settings-rejected": "Choose settings that the scene allows.",
  "strict-warnings": "Correct what the warnings name, or render without “refuse a scene with warnings”.",
  "time-limit": "Make the scene lighter, or ask the operator for more time.",
  "memory-limit": "Make textures, subdivision or the picture smaller, or ask the operator for more memory.",
  "storage-limit": "Render fewer frames or a smaller picture.",
  "renderer-crashed": "This is a fault of the renderer. Report it with the scene; the log may have details.",
  "render-failed": "The log may have details.",
  "checkpoint-unusable": "Render it again.",
  "job-expired": "Submit it again with a longer time to live.",
  "storage-full": "Ask the operator to make room, then try again.",
  unavailable: "Try again in a moment.",
  internal: "Try again; if it happens again, report it with the request's id.",
  "no-answer": "Check that the server is running and that the network works; this page tries again by itself.",
};

export const slugOf = (problem) => String(problem.type ?? "").replace("/problems/", "");

// Returns the code of a job's failure, for lists: the renderer's own code if the error is the renderer's.
export const codeOf = (problem) => String(problem.code || slugOf(problem));

export const adviceFor = (problem) => ADVICE[slugOf(problem)] ?? "";
