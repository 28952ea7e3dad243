// What is known of the service, and when it was heard; what shows it asks here.

import { get, listen, Refused, token } from "./link.js";
import { Ring } from "./ring.js";
import { doubts } from "./verdict.js";

/** How often what is shown as text changes at most, in ms: nobody reads faster. */
const TEXT_MS = 500;
/** After how many s without a word, not even that it lives, a stream is given up. */
const DEAF_S = 12;
/** After how many s without any answer the connection counts as lost. */
const SILENT_S = 6;
/** How often a lost connection is tried again at least, in s. */
const SLOWEST_S = 3;
const EVENTS = 200;

export const ring = new Ring();

/** All that is known. What the service does not have is `false`, what it has not said yet `null`. */
export const known = {
  status: null, channels: null, nodes: null, axes: null, alarms: null, graph: null, kept: null, events: [],
  tick: null, values: {}, seen: new Map(), dropped: 0, shadow: [], held: new Map(), problems: {}, found: [], needs_token: false,
};

/** How the connection is: since when it is lost, why, and in how many s it is tried again. */
const link = { lost_since: null, why: "", again_at: null, heard: null };
let tick_at = null;
let tick_s = null;
let degraded_since = null;
let answered_at = null;

const readers = new Set();
const tickers = new Set();
export const on_change = (reader) => (readers.add(reader), () => readers.delete(reader));
export const on_tick = (ticker) => (tickers.add(ticker), () => tickers.delete(ticker));

const seconds = () => Date.now() / 1000;
/** When something was heard, by a clock that may be set and by one that may stand still: what is older by either counts. */
const heard_now = () => ({ wall: seconds(), steady: performance.now() / 1000 });
const age = (of) => Math.max(seconds() - of.wall, performance.now() / 1000 - of.steady);
let shown_at = 0;
let waits = 0;

/** Shows what is known now, or soon where it was shown just now. */
export function changed(at_once = false) {
  const wait = at_once ? 0 : Math.max(0, shown_at + TEXT_MS - performance.now());
  if (wait === 0) {
    clearTimeout(waits);
    waits = 0;
    shown_at = performance.now();
    readers.forEach((reader) => reader());
  } else waits ||= setTimeout(() => changed(true), wait);
}

/** How many s there are between ticks, as the service or else the page has seen. */
export const interval_s = () => known.axes?.tick_s ?? tick_s;

/** The unit of a channel, as far as the service tells. */
export const unit_of = (name) => (known.kept ? known.kept.known.get(name)?.unit ?? "" : "");

/** How long a value of a channel counts without a newer one, in s: a curve goes on for so long. */
export const max_age = (name) => (known.kept ? known.kept.known.get(name)?.max_age_s ?? 0 : 0);

/** The value of a channel that counts now: its last one, for as long as it does; null where there is none. */
export function counts(name) {
  const value = known.values[name];
  const last = known.seen.get(name);
  if (value != null || !last) return value ?? null;
  return known.tick.time_s - last.at <= max_age(name) ? last.value : null;
}

/** Looks whether what is shown is still true. */
export function judge() {
  const now = seconds();
  const again_s = link.again_at === null ? null : link.again_at - now;
  const server = known.axes ? known.axes.stale : null;
  const silent_s = answered_at === null ? 0 : age(answered_at);
  const lost = link.lost_since === null && silent_s > SILENT_S
    ? { ...link, lost_since: now - silent_s, why: "it does not answer", again_s } : { ...link, again_s };
  const found = doubts({ now, link: lost, tick: tick_at === null ? now : now - age(tick_at), has_ticked: known.tick !== null, tick_s: interval_s(), server, status: known.status || null, degraded_since });
  const kinds = (of) => of.map((one) => one.kind).join();
  const is_news = kinds(found) !== kinds(known.found);
  known.found = found;
  if (is_news || found.length > 0) changed(is_news);
}

function take_tick(tick) {
  if (known.tick && tick.time_s > known.tick.time_s) {
    const step = tick.time_s - known.tick.time_s;
    tick_s = tick_s === null ? step : tick_s + 0.2 * (step - tick_s);
  }
  if (known.tick && tick.time_s < known.tick.time_s) known.seen.clear();
  tick_at = heard_now();
  known.tick = tick;
  known.values = { ...tick.outputs, ...tick.channels };
  for (const [name, value] of Object.entries(known.values)) if (value !== null) known.seen.set(name, { at: tick.time_s, value });
  ring.push(tick.time_s, known.values);
  tickers.forEach((ticker) => ticker());
  if (known.found.length > 0) judge();
  changed();
}

function take_event(event) {
  known.events = [...known.events, event].slice(-EVENTS);
  ask_status();
}

/** Reads the stream for as long as the page is open, and begins again whenever it ends. */
async function follow() {
  for (let failures = 0; ; failures += 1) {
    const stop = new AbortController();
    const watch = setInterval(() => seconds() - link.heard > DEAF_S && stop.abort(), 1000);
    let error = new Error("the service ended it");
    link.heard = seconds();
    try {
      await listen("/v1/events?channel=*", stop.signal, (kind, facts) => {
        failures = 0;
        link.heard = seconds();
        answered_at = heard_now();
        if (link.lost_since !== null) {
          Object.assign(link, { lost_since: null, again_at: null });
          missed();
          judge();
          refresh();
        }
        if (kind === "tick") take_tick(facts);
        else if (kind === "event") take_event(facts);
        else if (kind === "dropped") {
          known.dropped += facts.items;
          missed();
        }
      });
    } catch (caught) {
      error = caught;
    }
    clearInterval(watch);
    if (error.status === 401) await needs_token();
    const wait = error.again_s ?? Math.min(SLOWEST_S, 0.5 * 2 ** failures);
    const why = error instanceof Refused ? error.message : stop.signal.aborted ? "it gave nothing for a while" : "it was cut";
    link.lost_since ??= answered_at?.wall ?? seconds();
    Object.assign(link, { why, again_at: seconds() + wait });
    judge();
    changed(true);
    await new Promise((done) => setTimeout(done, wait * 1000));
  }
}

/** Ticks were missed: where the service remembers them, it is asked. */
function missed() {
  if (known.kept) ring.restart();
}

/** Nothing is asked for until a token is typed. */
async function needs_token() {
  token.forget();
  known.needs_token = true;
  changed(true);
  while (known.needs_token) await new Promise((done) => setTimeout(done, 200));
}

/** Asks for a part again and again while somebody looks. One that the service does not have is not asked for again. */
function poll(part, path, every_s, taken = () => {}) {
  const step = async () => {
    const address = path();
    if (!document.hidden && address && !known.needs_token) {
      try {
        const answer = await get(address);
        answered_at = heard_now();
        known[part] = answer;
        delete known.problems[part];
        taken(answer);
      } catch (error) {
        if (error.status > 0) answered_at = heard_now();
        if (error.status === 404) known[part] = false;
        else known.problems[part] = error.message;
        if (error.status === 401) await needs_token();
      }
      changed();
    }
    if (known[part] !== false) setTimeout(step, (address ? every_s : 0.3) * 1000);
  };
  step();
  return step;
}

function take_status(status) {
  if (status.state === "running") degraded_since = null;
  else degraded_since ??= since_event(status) ?? seconds();
  take_verdict(status);
  const seen = new Set(known.events.map((of) => `${of.host_time_s} ${of.message}`));
  const more = status.events.filter((of) => !seen.has(`${of.host_time_s} ${of.message}`));
  if (more.length) known.events = [...known.events, ...more].sort((a, b) => a.host_time_s - b.host_time_s).slice(-EVENTS);
  judge();
}

/** How often errors in the shadow are kept at most: half of them go where there are more. */
const VERDICTS = 1000;
let compared = null;

/** Keeps the errors of a comparison as they come. */
function take_verdict({ verdict, staged }) {
  if (!verdict) return;
  const last = known.shadow[known.shadow.length - 1];
  const n = (of) => of.outputs.reduce((sum, one) => sum + one.n, 0);
  if ((staged && staged.revision !== compared) || (last && n(verdict) < n(last))) known.shadow = [];
  if (staged) compared = staged.revision;
  if (last && known.shadow.length && n(last) === n(verdict)) return;
  known.shadow.push({ time: seconds(), outputs: verdict.outputs });
  if (known.shadow.length > VERDICTS) known.shadow = known.shadow.filter((_, nth) => nth % 2 === 0);
}

/** When a service became degraded, where an event tells. */
function since_event(status) {
  const grave = ["journal", "node_given_up", "missed", "source_failed"];
  const last = status.events.findLast((of) => grave.includes(of.event) && of.level === "warning");
  return last ? last.host_time_s : null;
}

/** Names the curves that are drawn live: those of the axes. */
function take_axes(axes) {
  for (const axis of axes.axes) Object.values(axis.channels ?? {}).flat().forEach((name) => ring.want(name));
  for (const { axis, why } of axes.axes) {
    const was = known.held.get(axis);
    if (!why) known.held.set(axis, null);
    else if (!was) known.held.set(axis, { since: axes.last_s, is_first: was === undefined });
  }
  judge();
}

/** Every so many s it is asked which channels are kept: another graph may have taken over. */
const KEPT_S = 30;
const take_kept = (kept) => Object.assign(kept, { known: new Map(kept.channels.map((of) => [of.channel, of])) });

let graph_of = null;
async function ask_status() {
  try {
    known.status = await get("/v1/status");
    answered_at = heard_now();
    take_status(known.status);
  } catch (error) {
    known.problems.status = error.message;
    if (error.status === 401) await needs_token();
  }
  changed(true);
}

/** Asks for everything now, as after an order. */
export const refresh = () => ask_status();

/** Begins: with the one question that shows whether a token is needed. */
export async function start() {
  tick_at = heard_now();
  setInterval(judge, 250);
  document.addEventListener("visibilitychange", () => !document.hidden && judge());
  await ask_status();
  follow();
  poll("axes", () => "/v1/axes", 1, take_axes);
  poll("kept", () => "/v1/history", KEPT_S, take_kept);
  poll("status", () => "/v1/status", 2, take_status);
  poll("channels", () => "/v1/channels", 2);
  poll("nodes", () => "/v1/nodes", 5);
  poll("alarms", () => "/v1/alarms", 2);
  poll("graph", () => (known.status?.revision && known.status.revision !== graph_of ? "/v1/graph" : null), 2, () => {
    graph_of = known.status?.revision;
  });
}
