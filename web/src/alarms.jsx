// Alarms: those that are raised first, and who acknowledged which.

import { useState } from "preact/hooks";
import { order } from "./orders.jsx";
import { known } from "./store.js";
import { clock, counted, figure, lasting, plain } from "./words.js";

/** How many changes are listed. */
const SHOWN = 100;
const RANKS = { raised: 0, acknowledged: 1, clear: 2 };

export function Alarms() {
  const [refused, refuse] = useState(null);
  if (!known.alarms || known.alarms.alarms.length === 0) return null;
  const { alarms, changes } = known.alarms;
  const now = known.tick?.time_s ?? Date.now() / 1000;
  const sorted = [...alarms].sort((a, b) => RANKS[a.state] - RANKS[b.state]);
  const raised = alarms.filter((of) => of.state === "raised").length;
  const acknowledge = async (name) => {
    const answer = await order("/v1/alarms/acknowledge", { name });
    refuse(answer?.refused ? `${name}: ${answer.refused.message}` : null);
  };
  return (
    <section aria-labelledby="alarms">
      <h2 id="alarms">Alarms{raised ? `: ${raised} raised` : ""}</h2>
      <div role="status">{refused && <p class="bad">{refused}</p>}</div>
      <ul class="alarms">
        {sorted.map((of) => (
          <li key={of.name} class={of.state}>
            <b class="what">{of.state}</b>
            <span>
              <b>{of.name}</b>: {of.text || of.of} {of.value != null && <>({of.of} is {figure(of.value)} {of.unit})</>}
              <span class="muted"> since {clock(of.since_s)}{of.state === "clear" ? "" : ` (${lasting(Math.max(0, now - of.since_s))})`}{of.by ? `, by ${of.by}` : ""}</span>
            </span>
            {of.state === "raised" && <button type="button" onClick={() => acknowledge(of.name)}>Acknowledge<span class="hidden"> {of.name}</span></button>}
          </li>
        ))}
      </ul>
      {changes.length > 0 && (
        <details>
          <summary>{counted(changes.length, "change")}</summary>
          <div class="log" tabIndex={0} role="region" aria-label="Changes of alarms"><ul>
            {changes.slice(-SHOWN).reverse().map((of) => (
              <li key={of.number}>
                <time>{clock(of.time_s)}</time> <b>{of.alarm}</b> {plain(of.change)}{of.value == null ? "" : ` at ${figure(of.value)} ${of.unit ?? ""}`}{of.by ? ` by ${of.by}` : ""}
              </li>
            ))}
          </ul></div>
        </details>
      )}
    </section>
  );
}
