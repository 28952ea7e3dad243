// Which stretch of time all curves show, and what the service remembers of it.

import { get } from "./link.js";
import { interval_s, known, on_change, ring } from "./store.js";
import { add_history, add_ticks, nothing } from "./stretches.js";
import { INTERVALS, LEAST_SILENCE_S, stops_curves } from "./verdict.js";

/** How many points a curve has at most; one of two pixels is enough for anybody. */
export const POINTS = 1000;
const LEAST_S = 1;
const MOST_S = 8 * 86400;

/** Live, so many s up to now, or an interval that stands still. */
export const view = { live: true, span: 600, from: 0, to: 0 };
const watchers = new Set();
export const on_view = (watcher) => (watchers.add(watcher), () => watchers.delete(watcher));
const moved = () => watchers.forEach((watcher) => watcher());

/** The newest instant that is known. */
export function newest() {
  return known.tick?.time_s ?? known.axes?.last_s ?? known.status?.last_s ?? Date.now() / 1000;
}

/** How often in its span a live picture moves on: in between, what is new is only added to it. */
const MOVES = 25;

/** From where to where curves are shown. Where nothing comes any more, what is missing is left empty. */
export function shown() {
  if (!view.live) return [view.from, view.to];
  const end = stops_curves(known.found) ? newest() + silence() : newest();
  const step = view.span / MOVES;
  const to = Math.ceil(end / step) * step;
  return [to - view.span, to];
}

function silence() {
  const since = known.found.find((of) => of.kind === "no_tick" || of.kind === "lost")?.since;
  return since ? Math.max(0, Date.now() / 1000 - since) : 0;
}

export function live(span = view.span) {
  Object.assign(view, { live: true, span });
  moved();
}

export function look(from, to) {
  const span = Math.min(Math.max(to - from, LEAST_S), MOST_S);
  const middle = (from + to) / 2;
  Object.assign(view, { live: false, span, from: middle - span / 2, to: middle + span / 2 });
  moved();
}

/** Moves by so many spans, or back to what is live where that would be ahead of it. */
export function pan(spans) {
  const [from, to] = shown();
  const by = spans * (to - from);
  if (to + by > newest()) live(to - from);
  else look(from + by, to + by);
}

/** Shows so many times as much, about an instant or, live, up to now. */
export function zoom(factor, about = null) {
  const [from, to] = shown();
  const span = Math.min(Math.max((to - from) * factor, LEAST_S), MOST_S);
  if (view.live && about === null) return live(span);
  const at = about ?? (from + to) / 2;
  const share = (at - from) / (to - from);
  return look(at - share * span, at + (1 - share) * span);
}

/** What the service remembers of some channels, asked for anew once it is too short or too coarse. */
export class Past {
  constructor(channels) {
    this.channels = channels;
    this.history = null;
    this.asked_at = 0;
    this.is_asking = false;
  }

  /** The curves of an interval, as far as they are known. */
  curves(from, to) {
    const curves = nothing(this.channels);
    const step = (to - from) / POINTS;
    const live_from = ring.since(this.channels);
    if (from >= live_from) return { ...add_ticks(curves, ring, this.channels, from - step, to, step), step };
    this.ask(from, to, live_from);
    const of = this.history;
    if (!of) return { ...add_ticks(curves, ring, this.channels, from - step, to, step), step };
    add_history(curves, of, this.channels, from - of.step_s, to);
    const end = of.time_s.length ? of.time_s[of.time_s.length - 1] : -Infinity;
    add_ticks(curves, ring, this.channels, Math.max(end, from - step), to, Math.max(step, of.step_s));
    return { ...curves, step: Math.max(step, of.step_s) };
  }

  /** Asks unless what is there will do, but not more often than each second. */
  async ask(from, to, live_from) {
    const of = this.history;
    const step = Math.max((to - from) / POINTS, interval_s() ?? 0);
    const fits = of && of.asked.from <= from + step && Math.min(to, live_from) <= of.asked.to + step
      && of.step_s <= 4 * step && of.asked.to - of.asked.from <= 2.5 * (to - from);
    const kept = known.kept ? this.channels.filter((name) => known.kept.known.has(name)) : [];
    if (this.is_asking || kept.length === 0 || performance.now() - this.asked_at < 1000) return;
    if (fits && performance.now() - this.asked_at < Math.max(30_000, (to - from) * 50)) return;
    this.is_asking = true;
    this.asked_at = performance.now();
    const names = kept.map((name) => `channel=${encodeURIComponent(name)}`).join("&");
    try {
      const history = await get(`/v1/history?${names}&from=${from}&to=${to}&points=${POINTS}`, 20);
      this.history = { ...history, asked: { from, to } };
      delete known.problems.history;
    } catch (error) {
      known.problems.history = error.message;
    }
    this.is_asking = false;
    moved();
  }
}

/** The longest distance between two points that a curve passes over. */
export const hole = (step) => Math.max(INTERVALS * Math.max(step, interval_s() ?? 0), LEAST_SILENCE_S);

let [was_stopped, was_kept] = [false, false];
on_change(() => {
  const [stops, is_kept] = [stops_curves(known.found), Boolean(known.kept)];
  if (stops || was_stopped || is_kept !== was_kept) moved();
  [was_stopped, was_kept] = [stops, is_kept];
});
