// Sources and sensors: what each gives, how old it is, what fails, and what was left out and why.

import { useState } from "preact/hooks";
import { counts, known, unit_of } from "./store.js";
import { ABSENT, clock, count, figure, lasting, plain } from "./words.js";

const NOT_REASONS = new Set(["source", "channel", "accepted", "age_s", "unit"]);

/** What was left out, by reason; nothing where nothing was. */
function left_out(of) {
  return Object.entries(of).filter(([name, n]) => !NOT_REASONS.has(name) && typeof n === "number" && n > 0);
}

const reasons = (of) => left_out(of).map(([name, n]) => `${count(n)} ${plain(name)}`).join(", ");

export function Sources() {
  const all = known.status?.sources ?? [];
  if (all.length === 0) return null;
  return (
    <section aria-labelledby="sources">
      <h2 id="sources">Sources</h2>
      <div class="wide" tabIndex={0} role="region" aria-labelledby="sources">
        <table>
          <thead><tr><th scope="col">source</th><th scope="col" class="left">connection</th><th scope="col">samples</th><th scope="col">wait</th><th scope="col">dropped</th><th scope="col">restarts</th><th scope="col" class="left">left out</th></tr></thead>
          <tbody>
            {all.map((of) => (
              <tr key={of.source}>
                <th scope="row">{of.source}</th>
                <td class={`left ${of.connected ? "good" : "bad"}`}>{of.connection === "never" ? "never connected" : plain(of.connection)}</td>
                <td>{count(of.given)}</td><td>{count(of.waiting)}</td><td class={of.dropped ? "bad" : ""}>{count(of.dropped)}</td><td>{count(of.restarts)}</td>
                <td class="left">{reasons(of.left_out) || ABSENT}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

/** What is wrong with each channel, as far as monitors have found. */
function faults() {
  const found = new Map();
  const add = (channel, words) => found.set(channel, [...(found.get(channel) ?? []), words]);
  const watched = known.status?.watched;
  for (const of of watched?.faults ?? []) {
    add(of.channel, `${of.value == null ? plain(of.fault) : `${plain(of.fault)} at ${figure(of.value)}`} since ${clock(of.since_s)}`);
  }
  for (const of of watched?.outside_fit ?? []) {
    add(of.channel, `${count(of.samples)} samples far outside of the fit: ${figure(of.lowest)} to ${figure(of.highest)}, there ${figure(of.lowest_in_fit)} to ${figure(of.highest_in_fit)}`);
  }
  return found;
}

export function Sensors() {
  const [filter, search] = useState("");
  const [only, let_only] = useState(false);
  const all = known.channels?.channels ?? [];
  if (all.length === 0) return null;
  const wrong = faults();
  const doubtful = (of) => wrong.has(of.channel) || left_out(of).length > 0;
  const listed = all.filter((of) => of.channel.toLowerCase().includes(filter.toLowerCase()) && (!only || doubtful(of)));
  const troubled = all.filter(doubtful).length;
  return (
    <section aria-labelledby="sensors">
      <h2 id="sensors">Sensors</h2>
      <div class="times">
        <label>Find <input type="search" value={filter} onInput={(event) => search(event.currentTarget.value)} /></label>
        <label><input type="checkbox" checked={only} onChange={(event) => let_only(event.currentTarget.checked)} /> only with faults or samples left out ({troubled})</label>
        <span class="muted">{listed.length} of {all.length}</span>
      </div>
      <div class="wide tall" tabIndex={0} role="region" aria-labelledby="sensors">
        <table>
          <thead><tr><th scope="col">channel</th><th scope="col">value</th><th scope="col" class="left unit">unit</th><th scope="col">age</th><th scope="col">samples</th><th scope="col" class="left">source</th><th scope="col" class="left">faults and samples left out</th></tr></thead>
          <tbody>
            {listed.map((of) => {
              const value = counts(of.channel);
              const words = [...(wrong.get(of.channel) ?? []), reasons(of) && `left out: ${reasons(of)}`].filter(Boolean);
              return (
                <tr key={`${of.source} ${of.channel}`} class={wrong.has(of.channel) ? "faulty" : ""}>
                  <th scope="row">{of.channel}</th>
                  <td>{value == null ? "absent" : figure(value, 6)}</td>
                  <td class="left unit">{unit_of(of.channel)}</td>
                  <td>{of.age_s == null ? "never" : lasting(of.age_s)}</td>
                  <td>{count(of.accepted)}</td>
                  <td class="left">{of.source ?? "none"}</td>
                  <td class="left">{words.join("; ") || ABSENT}</td>
                </tr>
              );
            })}
          </tbody>
        </table>
      </div>
      {known.status?.watched?.no_output && (
        <p class="bad">No output has had a value in {count(known.status.watched.no_output.ticks)} ticks; the first to lack one is {known.status.watched.no_output.first_silent}.</p>
      )}
    </section>
  );
}
