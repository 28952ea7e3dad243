// When pictures are drawn: as ticks come, but so seldom that drawing takes a small share of a core.

import { known, on_tick } from "./store.js";
import { on_view } from "./view.js";

/** Which share of time drawing may take. */
const SHARE = 0.05;
const SLOWEST_MS = 2000;

const charts = new Map();
const asked = new WeakSet();
let waits = false;
let timer = 0;
let anew = true;
let next_at = 0;
let cost_ms = 4;

/** Draws a chart from now on while it can be seen. */
export function draws(chart, element) {
  const seen = new IntersectionObserver(([entry]) => {
    charts.set(chart, entry.isIntersecting);
    if (entry.isIntersecting) soon();
  });
  charts.set(chart, false);
  seen.observe(element);
  return () => {
    seen.disconnect();
    charts.delete(chart);
  };
}

/** Draws at the next picture of the screen: what somebody has moved is not waited for. */
export function soon() {
  anew = true;
  next_at = 0;
  if (timer) {
    clearTimeout(timer);
    begin();
  } else ask();
}

function begin() {
  timer = 0;
  requestAnimationFrame(draw);
}

function ask() {
  if (waits || document.hidden || ![...charts.values()].some(Boolean)) return;
  waits = true;
  const wait = next_at - performance.now();
  if (wait > 5) timer = setTimeout(begin, wait);
  else begin();
}

/** Draws, and measures what that took, with what the browser does to show it. */
function draw() {
  const begun = performance.now();
  const done = new MessageChannel();
  done.port1.onmessage = () => {
    const took = performance.now() - begun;
    cost_ms += 0.3 * (took - cost_ms);
    next_at = begun + Math.min(cost_ms / SHARE, SLOWEST_MS);
    waits = false;
    done.port1.close();
  };
  // What cannot be drawn now is tried again with the next tick.
  done.port2.postMessage(null);
  const is_anew = anew;
  anew = false;
  for (const [chart, is_seen] of charts) {
    // Each is drawn once, so that what was before is there when it is printed.
    if (is_seen || (known.kept && !asked.has(chart))) chart.draw(is_anew);
    if (known.kept) asked.add(chart);
  }
}

on_tick(ask);
on_view(soon);
document.addEventListener("visibilitychange", () => !document.hidden && soon());
