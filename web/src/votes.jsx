// Weights of voters over time, novelty, and what each sensor and voter has in a prediction now.

import { useEffect, useState } from "preact/hooks";
import { coloured, Times } from "./drift.jsx";
import { get } from "./link.js";
import { Plot } from "./plot.jsx";
import { useSeen } from "./seen.jsx";
import { known } from "./store.js";
import { clock, figure } from "./words.js";

/** What stands behind the last `/` or `-` of `vote:weights.Z1/weight-thermal`. */
const voter = (channel) => channel.replace(/^.*\/(weight-)?/, "");
const node = (channel) => channel.replace(/:novelty\b/, "");

export function Votes() {
  const axes = known.axes ? known.axes.axes : [];
  const voted = axes.filter((of) => of.channels?.weights?.length);
  const novelty = [...new Set(axes.flatMap((of) => of.channels?.novelty ?? []))];
  if (voted.length === 0 && novelty.length === 0) return null;
  return (
    <section aria-labelledby="votes">
      <h2 id="votes">Votes and novelty</h2>
      <Times />
      <div class="many">
        {voted.map((axis) => (
          <div key={axis.axis}>
            <h3>Weights of the voters of {axis.axis}</h3>
            <Plot name={`Weights of the voters of ${axis.axis}`} lines={coloured(axis.channels.weights, voter)} unit="" height={150} />
          </div>
        ))}
        {novelty.length > 0 && (
          <div>
            <h3>Novelty; above 1 a prediction is outside of its fit</h3>
            <Plot name="Novelty" lines={coloured(novelty, node)} limit={1} unit="" height={150} />
          </div>
        )}
      </div>
    </section>
  );
}

/** Asked for while it is seen: each part of one prediction. */
export function Contributions() {
  const axes = known.axes ? known.axes.axes.filter((of) => of.channels?.predicted?.length) : [];
  const [wanted, want] = useState(null);
  const [of, know] = useState(null);
  const [why_not, lack] = useState("");
  const [place, is_seen] = useSeen(Boolean(of));
  const output = wanted ?? axes[0]?.channels.predicted[0];
  const rests = of !== null && !is_seen;
  useEffect(() => {
    if (!output || of === false || rests) return undefined;
    let is_over = false;
    const step = async () => {
      if (document.hidden || known.needs_token || !known.tick) return;
      // Without a value there is nothing to take apart, and no need to ask.
      if (known.values[output] === null) return lack("it has no value at this tick");
      try {
        const answer = await get(`/v1/contributions?output=${encodeURIComponent(output)}`);
        if (!is_over) know(answer);
        return lack("");
      } catch (error) {
        return error.status === 404 && /nothing is here/.test(error.message) ? know(false) : lack(error.message);
      }
    };
    step();
    const timer = setInterval(step, 2000);
    return () => ((is_over = true), clearInterval(timer));
  }, [output, of === false, rests]);
  if (!output || of === false || (of === null && !why_not)) return null;
  const is_there = of?.output === output;
  const parts = is_there ? [...of.parts].sort((a, b) => Math.abs(b.value) - Math.abs(a.value)) : [];
  const most = Math.max(...parts.map((part) => Math.abs(part.value)), Math.abs(of?.rest ?? 0), 1e-300);
  return (
    <section aria-labelledby="parts-of" ref={place}>
      <h2 id="parts-of">What a prediction is made of</h2>
      <div class="times">
        <label>Prediction <select value={output} onChange={(event) => want(event.currentTarget.value)}>
          {axes.flatMap((axis) => axis.channels.predicted).map((name) => <option key={name} value={name}>{name}</option>)}
        </select></label>
        {is_there && <span><b>{figure(of.value)} {of.unit}</b> <span class="muted">at {clock(of.time_s)}</span></span>}
      </div>
      {why_not && <p class="muted">It cannot be taken apart now: {why_not}{is_there ? `; below is what it was made of at ${clock(of.time_s)}` : ""}.</p>}
      {is_there && (
        <div class="wide tall" tabIndex={0} role="region" aria-labelledby="parts-of">
          <table>
            <thead><tr><th scope="col">sensor</th><th scope="col" class="left">voter</th><th scope="col">weight</th><th scope="col">{of.unit}</th><th scope="col" class="left"><span class="hidden">as a bar</span></th></tr></thead>
            <tbody>
              {parts.map((part) => (
                <tr key={`${part.voter} ${part.sensor}`}>
                  <th scope="row">{part.sensor}</th><td class="left">{part.voter}</td><td>{figure(part.weight, 3)}</td><td>{figure(part.value)}</td>
                  <td class="left"><Bar share={part.value / most} /></td>
                </tr>
              ))}
              <tr><th scope="row">rest</th><td class="left muted">constant and votes without parts</td><td /><td>{figure(of.rest)}</td><td class="left"><Bar share={of.rest / most} /></td></tr>
            </tbody>
          </table>
        </div>
      )}
    </section>
  );
}

function Bar({ share }) {
  const size = 60 * Math.abs(share);
  return (
    <svg class="bar" width="124" height="12" aria-hidden="true">
      <rect class={share < 0 ? "minus" : "plus"} x={share < 0 ? 62 - size : 62} width={size} height="12" />
      <line x1="62" x2="62" y1="0" y2="12" />
    </svg>
  );
}
