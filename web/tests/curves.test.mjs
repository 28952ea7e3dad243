// What pictures and verdicts are made of, without a browser.

import assert from "node:assert/strict";
import { test } from "node:test";
import { messages } from "../src/link.js";
import { Ring } from "../src/ring.js";
import { add_history, add_ticks, extremes, nothing } from "../src/stretches.js";
import { axis_sentence, doubts, may_measure, stops_curves } from "../src/verdict.js";
import { clock, figure, lasting } from "../src/words.js";

const filled = (ticks, of, capacity = 100) => {
  const ring = new Ring(capacity);
  ring.want("a");
  for (let nth = 0; nth < ticks; nth += 1) ring.push(nth, { a: of(nth) });
  return ring;
};

test("no extreme is lost to decimation", () => {
  const ring = filled(1000, (nth) => (nth === 333 ? 50 : nth === 666 ? -70 : nth % 3), 2000);
  const curves = add_ticks(nothing(["a"]), ring, ["a"], -1, 999, 100);
  assert.equal(curves.time.length, 10);
  assert.deepEqual(extremes(curves, [0], 0, 999), [-70, 50]);
  assert.equal(curves.highest[0][3], 50);
  assert.equal(curves.lowest[0][6], -70);
  assert.deepEqual(curves.last[0].slice(0, 2), [99 % 3, 199 % 3]);
});

test("what is absent is no value and no zero", () => {
  const ring = filled(10, (nth) => (nth === 4 ? null : nth));
  const curves = add_ticks(nothing(["a"]), ring, ["a"], -1, 9, 1);
  assert.equal(curves.lowest[0][4], null);
  assert.equal(curves.last[0][5], 5);
});

test("a ring keeps the last ticks alone, and begins anew where time goes back", () => {
  const ring = filled(250, (nth) => nth);
  assert.equal(ring.since(["a"]), 150);
  assert.deepEqual(ring.between(149, 151), [150, 152]);
  ring.push(10, { a: 1 });
  assert.equal(ring.since(["a"]), 10);
  assert.equal(ring.since(["b"]), Infinity);
});

test("what the service remembers and what came since are one curve", () => {
  const history = { channels: [{ channel: "a" }], time_s: [0, 10, 20], lowest: [[1, 2, null]], highest: [[3, 4, null]], last: [[2, 3, null]] };
  const curves = add_history(nothing(["a", "b"]), history, ["a", "b"], 5, 20);
  assert.deepEqual(curves.time, [10, 20]);
  assert.deepEqual(curves.highest, [[4, null], [null, null]]);
});

test("events are cut out of a stream wherever its pieces end", () => {
  const heard = [];
  const parse = messages((kind, facts) => heard.push([kind, facts]));
  for (const piece of [": ali", "ve\n\nevent: tick\nda", 'ta: {"time_s":1}\n', "\nevent: event\ndata: {\n\n"]) parse(piece);
  assert.deepEqual(heard, [["alive", null], ["tick", { time_s: 1 }]]);
});

const fine = { now: 100, link: { lost_since: null, again_s: null, why: "" }, tick: 99.9, has_ticked: true, tick_s: 0.1, server: null, status: { state: "running" }, degraded_since: null };

test("nothing outlives its data", () => {
  assert.deepEqual(doubts(fine), []);
  const silent = doubts({ ...fine, tick: 60, tick_s: 10 });
  assert.deepEqual([silent[0].kind, silent[0].since, silent[0].why], ["no_tick", 60, "they came each 10 s"]);
  assert.deepEqual(doubts({ ...fine, tick: 71, tick_s: 10 }), []);
  const lost = doubts({ ...fine, link: { lost_since: 95, why: "it was cut", again_s: 2 } });
  assert.deepEqual([lost[0].kind, lost[0].why], ["lost", "it was cut; tried again in 2 s"]);
  const degraded = doubts({ ...fine, status: { state: "degraded", revision: "a", journal: { is_degraded: true, error: "no space" } }, degraded_since: 90 });
  assert.deepEqual([degraded[0].kind, degraded[0].since], ["degraded", 90]);
  assert.match(degraded[0].why, /journal cannot be written \(no space\)/);
  assert.ok(stops_curves(silent) && stops_curves(lost) && !stops_curves(degraded));
  const server = { why: "no tick for 9 s; one comes each 1 s", since_s: 91 };
  assert.deepEqual(doubts({ ...fine, server }), [], "what came since is newer");
  const late = doubts({ ...fine, server, tick: 97, has_ticked: false });
  assert.deepEqual([late[0].kind, late[0].since], ["no_tick", 91], "the service knows since when");
  const behind = doubts({ ...fine, server: { why: "ticks are 40 s behind the sources", since_s: 60 } });
  assert.deepEqual([behind[0].kind, behind[0].since, behind[0].why], ["behind", 60, "ticks are 40 s behind the sources"]);
});

test("an axis may be measured while nothing is in doubt", () => {
  const axis = { may_measure: true, why: null, sentence: "Z1 drifts 12 nm/min; stable; may measure: yes" };
  assert.equal(may_measure(axis, []), "yes");
  assert.equal(may_measure({ ...axis, may_measure: false }, []), "no");
  assert.equal(may_measure({ ...axis, may_measure: null }, []), "unknown");
  for (const kind of ["lost", "no_tick", "degraded"]) assert.equal(axis_sentence(axis, [{ kind }]), "Z1 drifts 12 nm/min; stable; may measure: unknown");
  assert.equal(axis_sentence({ ...axis, sentence: "Z1: not known, no tick for 3 s" }, [{ kind: "no_tick" }]), "Z1: not known");
});

test("figures, durations and instants are short", () => {
  const figures = [[null, "–"], [0, "0"], [2, "2"], [-0.00001234, "−1.23e-5"], [12.3456, "12.35"], [-1234.5, "−1235"], [1.5e9, "1.50e+9"]];
  for (const [value, text] of figures) assert.equal(figure(value), text);
  const durations = [[0.42, "0.4 s"], [40, "40 s"], [240, "4 min"], [7500, "2 h 5 min"], [259_200, "3 days"], [NaN, "–"], [null, "–"]];
  for (const [seconds, text] of durations) assert.equal(lasting(seconds), text);
  assert.match(clock(1.7e9, 1.7e12), /^\d\d:\d\d:\d\d$/);
  assert.match(clock(1.7e9, 1.8e12), /^2023-11-1\d \d\d:\d\d:\d\d$/);
});
