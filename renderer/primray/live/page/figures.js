// What a viewer is doing, in words with the share that is done, and the figures of the picture that is shown and of a pixel's parts.

const PHASES = {
  opening: "Opening",
  drafting: "Drafting",
  preparing: "Preparing",
  rendering: "Refining",
  finished: "Finished",
  failed: "Failed",
};
const STEPS = {
  translate: "translating the stage",
  textures: "reading textures",
  dice: "dicing surfaces",
  build: "building the scene",
};

export function phaseWords({ phase, doing }) {
  const name = PHASES[phase] ?? phase;
  if (!doing) return name;
  const count = doing.all > 0 ? `, ${doing.done} of ${doing.all}` : "";
  return `${name}: ${STEPS[doing.step] ?? doing.step}${count}`;
}

export const shareOf = ({ number, of, done, all }) => (number - 1 + (all > 0 ? done / all : 0)) / of;

export function sizeWords({ size: [width, height], samples, seconds }) {
  return `${width} × ${height}, ${Number(samples.toFixed(1))} samples a pixel, ${seconds} s`;
}

export function errorWords({ relmse }) {
  if (!relmse) return "error not known yet";
  return `error (relMSE) ${brief(relmse[0])}, 95 %: ${brief(relmse[1])} to ${brief(relmse[2])}`;
}

// How long a step took from the hand to the eye.
export function stepWords(seconds) {
  return `${seconds.toFixed(2)} s a step, ${(1 / Math.max(seconds, 1e-3)).toFixed(0)} a second`;
}

export function selectedWords({ distance, instance, material }) {
  return `${distance.toPrecision(4)} away${instance ? `, in ${instance}` : ""}${material ? `, material ${material}` : ""}`;
}

export const RARE = "so rare that the error is hardly known: the true part may be several times larger, or smaller";

// The share of a pixel's light that a part has, in percent with its standard error; null: not known.
export function shareWords(share, error, isRare = false) {
  return `${percent(share)}${error === null ? "" : ` ± ${percent(error)}`} %${isRare ? " ?" : ""}`;
}

const percent = (share) => (100 * share).toFixed(1);
const brief = (number) => (Number.isFinite(number) ? number.toPrecision(2) : "?");
