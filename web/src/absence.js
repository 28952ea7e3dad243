// Why a node of the graph has no value: what it waits for, as far up as something is absent.

import { counts } from "./store.js";
import { clock, lasting, plain } from "./words.js";

/** The channels of a box without its further ports; all where it has no others. */
export function main_channels(box) {
  const main = box.channels.filter((name) => !name.includes(":"));
  return main.length ? main : box.channels;
}

/** How a box is: how many of its main channels have a value, and how old the oldest one is. */
export function state_of(box, known) {
  const names = main_channels(box);
  const now = known.tick?.time_s ?? NaN;
  const there = names.filter((name) => counts(name) !== null);
  const unheard = names.every((name) => !(name in known.values));
  const seen = names.flatMap((name) => known.seen.get(name)?.at ?? []);
  const age = names.length && seen.length ? now - Math.min(...seen) : null;
  const kind = unheard ? "unheard" : there.length === names.length ? "there" : there.length ? "partly" : "absent";
  return { names, there: there.length, of: names.length, age, kind, last: seen.length ? Math.max(...seen) : null };
}

/** Why a box has nothing, in words; null where it has all that it gives. */
export function why_absent(graph, nth, known) {
  const box = graph.boxes[nth];
  const state = state_of(box, known);
  if (state.kind === "there" || state.kind === "unheard") return null;
  const given_up = (known.status?.given_up ?? []).find((name) => box.nodes.includes(name) || name === box.name);
  if (given_up) return `${given_up} panicked and was given up`;
  const since = state.kind === "absent" && state.last !== null ? ` since ${clock(state.last)}` : "";
  const root = first_lack(graph, nth, known, new Set());
  const what = state.kind === "absent" ? `absent${since}` : `${state.of - state.there} of ${state.of} absent`;
  if (root !== nth) return `${what}: it waits for ${graph.boxes[root].name}${fault(graph.boxes[root], known)}`;
  const inputs = graph.arrows.some((of) => of.to === nth);
  return inputs ? `${what}: its inputs are there; it warms up, or is outside of what it may do` : `${what}${fault(box, known) || ": no new sample"}`;
}

/** The first box against the arrows that lacks something while nothing before it does. */
function first_lack(graph, nth, known, passed) {
  passed.add(nth);
  for (const arrow of graph.arrows) {
    if (arrow.to !== nth || arrow.flow !== "data" || passed.has(arrow.from)) continue;
    const kind = graph.boxes[arrow.from] && state_of(graph.boxes[arrow.from], known).kind;
    if (kind === "absent" || kind === "partly") return first_lack(graph, arrow.from, known, passed);
  }
  return nth;
}

/** What monitors have found of the channels of a box. */
function fault(box, known) {
  const found = (known.status?.watched?.faults ?? []).filter((of) => box.channels.includes(of.channel));
  if (found.length) return ` (${found.map((of) => `${of.channel} ${plain(of.fault)} since ${clock(of.since_s)}`).join(", ")})`;
  const away = (known.channels?.channels ?? []).filter((of) => box.channels.includes(of.channel) && of.age_s > 0 && counts(of.channel) === null);
  return away.length ? ` (${away.map((of) => `${of.channel} ${lasting(of.age_s)} old`).join(", ")})` : "";
}
