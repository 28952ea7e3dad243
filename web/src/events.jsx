// Who did what, when, and what happened.

import { useState } from "preact/hooks";
import { known } from "./store.js";
import { clock, count } from "./words.js";

export function Events() {
  const [only, let_only] = useState(false);
  const all = known.events.filter((of) => !only || of.level === "warning");
  return (
    <section aria-labelledby="events">
      <h2 id="events">Events</h2>
      <div class="times">
        <label><input type="checkbox" checked={only} onChange={(event) => let_only(event.currentTarget.checked)} /> only warnings</label>
        {known.dropped > 0 && <span class="bad">{count(known.dropped)} ticks and events came too fast for this page and are not shown.</span>}
      </div>
      {all.length === 0 ? <p class="muted">Nothing has happened since the service started.</p> : (
        <div class="log" tabIndex={0} role="region" aria-labelledby="events"><ul>
          {all.slice().reverse().map((of) => (
            <li key={`${of.host_time_s} ${of.message}`} class={of.level}>
              <time>{clock(of.host_time_s)}</time> {of.level === "warning" && <b class="bad">warning</b>} {of.message}
              {of.facts?.by ? <span class="muted"> by {of.facts.by}</span> : ""}
            </li>
          ))}
        </ul></div>
      )}
    </section>
  );
}
