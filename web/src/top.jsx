// The top: is it right now, may one measure, and since when not.

import { known } from "./store.js";
import { axis_sentence, may_measure, since, so_long } from "./verdict.js";
import { clock, count, counted, date, figure, lasting, short } from "./words.js";

/** What is in doubt, and since when. It is read out when it changes, and not as it lasts. */
export function Doubts() {
  const now = Date.now() / 1000;
  return (
    <>
      <div role="alert" class="hidden">{known.found.map((of) => `${of.what} ${since(of.since)}. `).join("")}</div>
      {known.found.map((of) => (
        <p key={of.kind} class={`doubt ${of.kind}`}>
          <b>{of.what} {since(of.since)}</b> {so_long(of.since, now)}: {of.why}
        </p>
      ))}
      {known.found.length > 0 && <p class="muted">What stands below is from {clock(known.tick?.time_s ?? known.axes?.last_s)}. May measure: unknown.</p>}
    </>
  );
}

/** Since when a correction is held, as far as this page has seen. */
function held(axis) {
  const of = known.held.get(axis);
  return of ? `so since ${clock(of.since)}${of.is_first ? " or before" : ""}` : "";
}

/** One sentence for each axis. */
export function Axes() {
  const axes = known.axes ? known.axes.axes : [];
  if (axes.length === 0) return null;
  return (
    <section aria-labelledby="now">
      <h2 id="now">Now</h2>
      <ul class="axes">
        {axes.map((axis) => {
          const verdict = may_measure(axis, known.found);
          return (
            <li key={axis.axis} class={verdict}>
              <span class={`badge ${verdict}`} aria-hidden="true">{{ yes: "✓", no: "✗", unknown: "?" }[verdict]}</span>
              <span>
                {axis_sentence(axis, known.found)}
                {axis.why && !axis.sentence.includes(axis.why) && <span> (correction: {axis.why})</span>}
                {axis.why && known.found.length === 0 && <span class="muted"> {held(axis.axis)}</span>}
              </span>
            </li>
          );
        })}
      </ul>
    </section>
  );
}

function Tile({ name, children, bad }) {
  return (
    <div class="tile">
      <dt>{name}</dt>
      <dd class={bad ? "bad" : ""}>{children}</dd>
    </div>
  );
}

/** Sources, engine, journal and model, in a line each. */
export function Parts() {
  const of = known.status;
  if (!of) return null;
  const away = of.sources.filter((source) => !source.connected);
  const failing = of.sinks.filter((sink) => sink.error);
  const { journal } = of;
  return (
    <section aria-labelledby="parts">
      <h2 id="parts" class="hidden">State</h2>
      <dl class="tiles">
        <Tile name="Sources" bad={away.length}>
          {away.length === 0 ? `${counted(of.sources.length, "source")}, all connected`
            : `${away.map((source) => `${source.source} ${source.connection === "never" ? "never connected" : "is away"}`).join(", ")}; of ${of.sources.length}`}
        </Tile>
        <Tile name="Engine" bad={of.given_up.length || of.behind_s > 30}>
          {count(of.ticks + of.beats)} ticks{known.axes?.tick_s ? `, one each ${lasting(known.axes.tick_s)}` : ""}, {lasting(of.behind_s)} behind, up {lasting(of.uptime_s)}
          {of.frozen ? "; learning is frozen" : ""}
          {of.given_up.length ? `; given up: ${of.given_up.join(", ")}` : ""}
        </Tile>
        <Tile name="Journal" bad={journal.is_degraded || journal.lost}>
          {journal.is_degraded ? `cannot be written: ${journal.error ?? "no reason is known"}` : `${count(journal.written)} records, ${count(journal.unsynced)} not on the disk yet`}
          {journal.lost ? `; ${count(journal.lost)} were never written` : ""}
        </Tile>
        <Tile name="Sinks" bad={failing.length}>
          {failing.length ? failing.map((sink) => `${sink.sink}: ${sink.error}`).join("; ")
            : of.sinks.length ? of.sinks.map((sink) => `${sink.sink} ${count(sink.put)} rows`).join(", ") : "none"}
        </Tile>
        <Tile name="Model" bad={of.revision === null}>
          {of.revision === null ? "not known: ticks were missed" : <>revision <code title={of.revision}>{short(of.revision)}</code></>}
          {of.fitted_s ? `, fitted ${lasting(Date.now() / 1000 - of.fitted_s)} ago (${date(of.fitted_s)})` : ""}
          {of.staged ? `; ${short(of.staged.revision)} is staged` : ""}
          {of.card ? <Card card={of.card} /> : null}
        </Tile>
      </dl>
    </section>
  );
}

/** What is known of how the model was fitted. */
function Card({ card }) {
  return (
    <details>
      <summary>Card</summary>
      <dl class="card">
        {Object.entries(card).map(([key, value]) => (
          <div key={key}><dt>{key}</dt><dd>{typeof value === "object" ? JSON.stringify(value) : figure(value)}</dd></div>
        ))}
      </dl>
    </details>
  );
}
