// What is staged in the shadow of what runs: the errors of both, as they come.

import { known } from "./store.js";
import { count, figure, short } from "./words.js";

export function Comparison({ verdict, staged }) {
  if (!verdict) return null;
  const passes = verdict.passes === null ? "there is nothing to compare yet" : verdict.passes ? "no worse than the margin allows" : "worse by more than the margin";
  return (
    <div>
      <h3>In the shadow{staged ? `: ${short(staged)}` : ""}</h3>
      <p>
        {verdict.over ? "The comparison is over: " : "It goes on: "}
        <b class={verdict.passes === false ? "bad" : verdict.passes ? "good" : ""}>{passes}</b>
        {verdict.ratio != null && `; the new error is ${figure(verdict.ratio, 4)} times that of what runs`}.
      </p>
      <div class="many">
        {verdict.outputs.map((of) => (
          <div key={of.output} class="wide">
            <h4>{of.output}</h4>
            <p class="legend">
              <span class="key c1" aria-hidden="true" /> running <b>{figure(of.running_rmse)}</b>
              <span class="key c2" aria-hidden="true" /> new <b>{figure(of.candidate_rmse)}</b>
              <span class="muted">RMSE in {of.unit}, {count(of.n)} instants</span>
            </p>
            <Errors name={of.output} />
          </div>
        ))}
      </div>
    </div>
  );
}

/** Both errors of an output since the comparison began, as far as this page was open. */
function Errors({ name }) {
  const points = known.shadow.flatMap(({ time, outputs }) => {
    const of = outputs.find((one) => one.output === name);
    return of && of.running_rmse != null && of.candidate_rmse != null ? [[time, of.running_rmse, of.candidate_rmse]] : [];
  });
  if (points.length < 2) return <p class="muted">Curves begin with the second figure.</p>;
  const [width, height, left] = [420, 90, 48];
  const [from, to] = [points[0][0], points[points.length - 1][0]];
  const top = Math.max(...points.flatMap(([, running, fresh]) => [running, fresh])) * 1.08 || 1;
  const line = (nth) => points.map((point) => `${left + ((point[0] - from) / (to - from || 1)) * (width - left)},${height - (point[nth] / top) * height}`).join(" ");
  return (
    <svg class="errors" viewBox={`0 -10 ${width} ${height + 20}`} role="img" aria-label={`Errors of ${name}: running and new`}>
      <line class="grid" x1={left} x2={width} y1={height} y2={height} />
      <line class="grid" x1={left} x2={width} y1="0" y2="0" />
      <text x={left - 6} y="4" text-anchor="end">{figure(top, 3)}</text>
      <text x={left - 6} y={height + 4} text-anchor="end">0</text>
      <polyline class="c1" points={line(1)} />
      <polyline class="c2" points={line(2)} />
    </svg>
  );
}
