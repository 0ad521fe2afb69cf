// Formats numbers and times for people.

export function bytes(count) {
  if (!Number.isFinite(count)) return "";
  const units = ["bytes", "kB", "MB", "GB", "TB"];
  let power = 0;
  let value = count;
  while (value >= 999.5 && power < units.length - 1) {
    value /= 1000;
    power += 1;
  }
  return `${power === 0 || value >= 99.95 ? Math.round(value) : value.toFixed(1)} ${units[power]}`;
}

export function duration(seconds) {
  if (!Number.isFinite(seconds) || seconds < 0) return "";
  if (seconds < 1) return `${seconds.toFixed(seconds < 0.1 ? 2 : 1)} s`;
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 60) return `${Math.round(seconds)} s`;
  const whole = Math.round(seconds);
  if (whole < 3600) return `${Math.floor(whole / 60)} min${whole % 60 ? ` ${whole % 60} s` : ""}`;
  if (whole < 86400) return `${Math.floor(whole / 3600)} h ${Math.round((whole % 3600) / 60)} min`;
  return `${Math.floor(whole / 86400)} d ${Math.round((whole % 86400) / 3600)} h`;
}

const SUPERSCRIPT = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

// Returns two significant digits: 0.021, 3.4·10⁻⁵.
export function error(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return "∞";
  if (value === 0) return "0";
  const power = Math.floor(Math.log10(Math.abs(value)) + 1e-9);
  if (power >= -3 && power < 4) return trimmed(value.toPrecision(2));
  return `${trimmed((value / 10 ** power).toPrecision(2))}·10${[...String(power)].map((digit) => SUPERSCRIPT[digit]).join("")}`;
}

// Returns enough digits to distinguish pixels.
export function fixed(value) {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "NaN" : value > 0 ? "∞" : "−∞";
  if (value !== 0 && (Math.abs(value) < 0.001 || Math.abs(value) >= 10000)) return error(value);
  return value.toFixed(Math.abs(value) < 10 ? 4 : Math.abs(value) < 1000 ? 2 : 0);
}

const trimmed = (text) => (text.includes("e") ? String(Number(text)) : text.replace(/(\.\d*[1-9])0+$|\.0+$/, "$1"));

export function count(value) {
  return Number.isFinite(value) ? Math.round(value).toLocaleString("en") : "–";
}

export function rate(value) {
  if (!Number.isFinite(value)) return "";
  if (value >= 1e6) return `${(value / 1e6).toFixed(value < 1e7 ? 1 : 0)} M/s`;
  return value >= 1e3 ? `${(value / 1e3).toFixed(0)} k/s` : `${value.toFixed(0)}/s`;
}

// Returns 12.3 % for finished work; percent() is for work in progress, and never shows 100 too soon.
export const percentOf = (fraction) => `${Number((100 * fraction).toFixed(1))} %`;

export const percent = (fraction) => `${Math.floor(100 * Math.min(1, Math.max(0, fraction)))} %`;

export function when(time) {
  const date = typeof time === "number" ? new Date(time * 1000) : new Date(time);
  if (!time || Number.isNaN(date.getTime())) return "";
  const today = new Date().toDateString() === date.toDateString();
  const clock = date.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
  return today ? clock : `${date.toLocaleDateString([], { year: "numeric", month: "short", day: "numeric" })}, ${clock}`;
}

export const plural = (n, one, many = `${one}s`) => `${n.toLocaleString("en")} ${n === 1 ? one : many}`;

export const shortId = (id) => (id ? `…${id.slice(-6)}` : "");
