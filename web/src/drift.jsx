// Drift measured, predicted and left, with its uncertainty; the correction and what holds it.

import { useState } from "preact/hooks";
import { Plot } from "./plot.jsx";
import { known, unit_of } from "./store.js";
import { live, pan, shown, view, zoom } from "./view.js";
import { clock, lasting } from "./words.js";

const SPANS = [["1 min", 60], ["100 s", 100], ["10 min", 600], ["1 h", 3600], ["8 h", 28_800], ["1 day", 86_400]];
const DASHES = [undefined, [6, 3], [2, 3], [8, 3, 2, 3]];
const COLOURS = ["c2", "c3", "c4", "c5", "c6", "c1"];

/** One line a channel of a kind: the second of a kind is dashed. */
function of_kind(axis, kind, label, colour) {
  return (axis.channels?.[kind] ?? []).map((channel, nth, all) => ({
    channel, colour, dash: DASHES[nth % DASHES.length], label: all.length > 1 ? `${label} (${channel})` : label,
  }));
}

/** Lines in the colours of a picture of many. */
export const coloured = (channels, label) =>
  channels.map((channel, nth) => ({ channel, label: label(channel), colour: COLOURS[nth % 6], dash: DASHES[Math.floor(nth / 6) % 4] }));

/** What is left is measured too: it is drawn once. */
function drift_lines(axis) {
  const left = axis.channels?.left ?? [];
  const measured = (axis.channels?.measured ?? []).filter((name) => !left.includes(name));
  const drawn = { channels: { ...axis.channels, measured } };
  return [...of_kind(drawn, "measured", "measured", "c1"), ...of_kind(drawn, "predicted", "predicted", "c2"), ...of_kind(drawn, "left", "left", "c3")];
}

function band_of({ channels }) {
  const [lower, upper] = [channels?.lower?.[0], channels?.upper?.[0]];
  if (lower && upper) return { lower, upper };
  const [of, std_dev] = [channels?.predicted?.[0], channels?.std_dev?.[0]];
  return of && std_dev ? { of, std_dev } : undefined;
}

/** Where the pictures are in time, and what moves them. */
export function Times() {
  const [from, to] = shown();
  const where = view.live ? `the last ${lasting(view.span)}, live` : `${clock(from)} to ${clock(to)}`;
  return (
    <div class="times" role="group" aria-label="Time that curves show">
      {SPANS.map(([words, span]) => (
        <button key={words} type="button" aria-pressed={view.live && view.span === span} onClick={() => live(span)}>{words}</button>
      ))}
      <span class="together">
        <button type="button" aria-label="Earlier" onClick={() => pan(-0.5)}>◀</button>
        <button type="button" aria-label="Zoom in" onClick={() => zoom(0.5)}>+</button>
        <button type="button" aria-label="Zoom out" onClick={() => zoom(2)}>−</button>
        <button type="button" aria-label="Later" onClick={() => pan(0.5)}>▶</button>
      </span>
      {!view.live && <button type="button" class="main" onClick={() => live()}>Back to live</button>}
      <span class="muted where">{where}</span>
    </div>
  );
}

export function Drift() {
  const axes = known.axes ? known.axes.axes : [];
  const [wanted, want] = useState(null);
  const chosen = wanted === "*" ? axes : axes.filter((of) => of.axis === (wanted ?? axes[0]?.axis));
  if (axes.length === 0) return null;
  const drawn = chosen.filter((axis) => drift_lines(axis).length);
  return (
    <section aria-labelledby="drift">
      <h2 id="drift">Drift</h2>
      <Times />
      {axes.length > 1 && (
        <div class="times" role="group" aria-label="Axes that are shown">
          {axes.map(({ axis }) => (
            <button key={axis} type="button" aria-pressed={chosen.length === 1 && chosen[0].axis === axis} onClick={() => want(axis)}>{axis}</button>
          ))}
          <button type="button" aria-pressed={wanted === "*"} onClick={() => want("*")}>all</button>
        </div>
      )}
      {known.problems.history && <p class="bad">What was before cannot be shown: {known.problems.history}; asked for again.</p>}
      {known.kept === false && <p class="muted">This service remembers nothing: curves begin when the page was opened.</p>}
      <div class={chosen.length > 1 ? "many" : "one"}>
        {drawn.map((axis) => (
          <div key={axis.axis}>
            {chosen.length > 1 && <h3>{axis.axis}</h3>}
            <Plot name={`Drift of ${axis.axis}`} lines={drift_lines(axis)} band={band_of(axis)} unit={axis.unit} height={chosen.length > 1 ? 180 : 280} />
          </div>
        ))}
      </div>
      {chosen.length === 1 && <Correction axis={chosen[0]} />}
      <p class="muted screen">Drag across a picture to look closer, double-click for what is live; the wheel with Ctrl or Shift zooms. On a tablet one finger moves and two zoom.</p>
    </section>
  );
}

function Correction({ axis }) {
  const lines = of_kind(axis, "correction", "correction", "c4");
  if (lines.length === 0) return null;
  return (
    <div>
      <h3>Correction</h3>
      <p class="muted">{axis.why ? <>Held back: <b>{axis.why}</b>.</> : "Nothing holds it back."}</p>
      <Plot name={`Correction of ${axis.axis}`} lines={lines} shade={axis.channels.why?.[0]} unit={unit_of(lines[0].channel)} height={160} />
    </div>
  );
}
