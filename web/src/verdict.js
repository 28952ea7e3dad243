// Whether what is shown is still true. Nothing outlives its data: what is old, or doubtful, is said to be so, and since when.

import { clock, lasting } from "./words.js";

/** How many intervals may pass without a tick. */
export const INTERVALS = 3;
/** Shorter silences than this are no news to anybody, in s. */
export const LEAST_SILENCE_S = 1;

/** What is wrong with what is shown, since when, and why: the gravest first. */
export function doubts(of) {
  const { now, link, tick, has_ticked, tick_s, server, status, degraded_since } = of;
  const found = [];
  if (link.lost_since !== null) {
    const again = link.again_s === null ? "" : `; tried again in ${lasting(Math.max(0, link.again_s))}`;
    found.push({ kind: "lost", what: "No connection to the service", since: link.lost_since, why: link.why + again });
  }
  const limit = Math.max(INTERVALS * (tick_s ?? Infinity), LEAST_SILENCE_S);
  const is_said = Boolean(server && /^no tick/.test(server.why));
  if (now - tick > limit || (is_said && limit === Infinity)) {
    const at = has_ticked || !is_said ? tick : server.since_s ?? tick;
    found.push({ kind: "no_tick", what: "No tick", since: at, why: tick_s ? `they came each ${lasting(tick_s)}` : "none has come yet" });
  } else if (server && !is_said && status?.state === "running" && found.length === 0) {
    found.push({ kind: "behind", what: "What is shown may be old", since: server.since_s ?? null, why: server.why });
  }
  if (status && status.state !== "running") {
    found.push({ kind: "degraded", what: `The service is ${status.state}`, since: degraded_since, why: reasons(status).join("; ") });
  }
  return found;
}

/** Why a service is degraded, as far as its status tells. */
export function reasons(status) {
  const found = [];
  if (status.journal?.is_degraded) found.push(`its journal cannot be written${status.journal.error ? ` (${status.journal.error})` : ""}`);
  if (status.given_up?.length) found.push(`given up: ${status.given_up.join(", ")}`);
  if (status.revision === null) found.push("ticks were missed by what looks on");
  const away = (status.sources ?? []).filter((source) => !source.connected).map((source) => source.source);
  if (away.length) found.push(`not connected: ${away.join(", ")}`);
  return found.length ? found : ["its log says why"];
}

/** Whether curves go on: not without data. */
export const stops_curves = (found) => found.some((of) => of.kind === "lost" || of.kind === "no_tick");

/** Whether an axis may be measured: yes, no, or unknown, which it is as soon as there is a doubt. What a held correction means, the service knows. */
export function may_measure(axis, found) {
  if (found.length > 0 || axis.may_measure === null || axis.may_measure === undefined) return "unknown";
  return axis.may_measure ? "yes" : "no";
}

/** The sentence of an axis. What the service says of measuring holds only while nothing is in doubt. */
export function axis_sentence(axis, found) {
  const said = axis.sentence.replace(/may measure: \w+/, `may measure: ${may_measure(axis, found)}`);
  // Why nothing is known stands above.
  if (found.length > 0) return said.replace(/: not known, .*/s, ": not known");
  return said;
}

/** Since when: an instant, which is read out once, and how long that is. */
export const since = (seconds) => (seconds === null ? "" : `since ${clock(seconds)}`);
export const so_long = (seconds, now) => (seconds === null ? "" : `(${lasting(Math.max(0, now - seconds))})`);
