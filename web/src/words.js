// How figures, instants and durations stand on the page.

/** What stands where nothing is. */
export const ABSENT = "–";

/** Enough digits to see a change: four of them, fewer zeros. */
export function figure(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return ABSENT;
  if (typeof value !== "number") return String(value);
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (Number.isInteger(value) && Math.abs(value) < 1e7) return minus(String(value));
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-4) return minus(value.toExponential(Math.max(digits - 2, 1)));
  const whole = size < 1 ? 0 : Math.floor(Math.log10(size));
  return minus(value.toFixed(Math.min(Math.max(digits - 1 - whole, 0), 4)));
}

function minus(text) {
  return /^-0(\.0+)?$/.test(text) ? text.slice(1) : text.replace("-", "−");
}

/** A count, in groups of thousands. */
export function count(value) {
  return typeof value === "number" ? value.toLocaleString("en") : ABSENT;
}

/** `1 source`, `3 sources`. */
export function counted(n, noun) {
  return `${count(n)} ${noun}${n === 1 ? "" : "s"}`;
}

/** How long: `0.4 s`, `40 s`, `4 min`, `2 h 5 min`, `3 days`. */
export function lasting(seconds) {
  if (typeof seconds !== "number" || !(seconds >= 0)) return ABSENT;
  if (seconds < 10) return `${+seconds.toFixed(1)} s`;
  if (seconds < 120) return `${Math.round(seconds)} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 120) return `${minutes} min`;
  const hours = Math.floor(minutes / 60);
  if (hours < 48) return minutes % 60 ? `${hours} h ${minutes % 60} min` : `${hours} h`;
  return `${Math.round(seconds / 86400)} days`;
}

const two = (n) => String(n).padStart(2, "0");

/** An instant as a clock shows it, with its date where that is another day than today. */
export function clock(seconds, now = Date.now()) {
  if (typeof seconds !== "number" || !Number.isFinite(seconds)) return ABSENT;
  const at = new Date(seconds * 1000);
  const time = `${two(at.getHours())}:${two(at.getMinutes())}:${two(at.getSeconds())}`;
  const is_today = at.toDateString() === new Date(now).toDateString();
  return is_today ? time : `${date(seconds)} ${time}`;
}

/** The day of an instant. */
export function date(seconds) {
  const at = new Date(seconds * 1000);
  return `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())}`;
}

/** The first letters of a revision, which are enough to know it by. */
export function short(revision) {
  return revision ? revision.slice(0, 8) : ABSENT;
}

/** A reason such as `out_of_range`, as words. */
export function plain(name) {
  return String(name).replaceAll("_", " ");
}
