// The graph that runs, with what its nodes give now, how old that is, and why there is nothing.

import { useEffect, useState } from "preact/hooks";
import { main_channels, state_of, why_absent } from "./absence.js";
import { coloured } from "./drift.jsx";
import { Plot } from "./plot.jsx";
import { useSeen } from "./seen.jsx";
import { counts, known, ring, unit_of } from "./store.js";
import { ABSENT, clock, figure, lasting, short } from "./words.js";

/** By how much boxes are wider and higher than drawn: there are values in them. */
const [WIDE, HIGH] = [1.25, 1.75];
const LINE = 16;
/** How many channels of a node are drawn at most. */
const CURVES = 6;
const MARKS = { there: "", partly: "◐ ", absent: "○ ", unheard: "" };

export function Graph() {
  const graph = known.graph;
  const [place, is_seen] = useSeen(Boolean(graph));
  const [chosen, choose] = useState(-1);
  const [is_whole, fit] = useState(false);
  if (!graph || !graph.boxes.length) return null;
  return (
    <section aria-labelledby="graph" ref={place}>
      <h2 id="graph">Graph</h2>
      <p class="muted">Revision {short(graph.revision)}. A node has what it gives now; ○ is absent, ◐ in part. Choose one for its ages and reasons.</p>
      <div class="times"><button type="button" aria-pressed={is_whole} onClick={() => fit(!is_whole)}>As wide as the page</button></div>
      {is_seen && <Picture graph={graph} chosen={chosen} choose={choose} is_whole={is_whole} />}
      {graph.boxes[chosen] && <Node graph={graph} nth={chosen} close={() => choose(-1)} />}
    </section>
  );
}

function Picture({ graph, chosen, choose, is_whole }) {
  const [width, height] = [graph.size[0] * WIDE + 20, graph.size[1] * HIGH + 20];
  return (
    <div class="wide" tabIndex={0} role="region" aria-labelledby="graph">
      <svg class={is_whole ? "graph whole" : "graph"} viewBox={`-10 -10 ${width} ${height}`} width={width} height={height} role="group" aria-label="Nodes of the graph">
        {graph.arrows.map((arrow, nth) => <path key={nth} class={`flow ${arrow.flow}`} d={curve(arrow)} />)}
        {graph.boxes.map((box, nth) => <Box key={`${box.class} ${box.name}`} graph={graph} nth={nth} is_chosen={nth === chosen} choose={choose} />)}
      </svg>
    </div>
  );
}

/** A curve along a way, level where it leaves, passes and arrives. */
function curve({ points, flow }) {
  const below = flow === "truth" ? 9 : 0;
  const at = points.map(([x, y]) => [x * WIDE, y * HIGH + below]);
  let path = `M${at[0][0]} ${at[0][1]}`;
  for (let nth = 1; nth < at.length; nth += 1) {
    const [[x, y], [to_x, to_y]] = [at[nth - 1], at[nth]];
    const bend = (to_x - x) / 2;
    path += ` C${x + bend} ${y} ${to_x - bend} ${to_y} ${to_x} ${to_y}`;
  }
  const [x, y] = at[at.length - 1];
  return `${path} M${x - 7} ${y - 4} L${x} ${y} L${x - 7} ${y + 4}`;
}

/** As many values as there is room for. */
function values(names, letters, lines) {
  const rows = [""];
  for (const name of names) {
    const text = figure(counts(name));
    const row = rows[rows.length - 1];
    if (row && row.length + text.length + 2 > letters) {
      if (rows.length === lines) {
        rows[rows.length - 1] = `${row} …`;
        break;
      }
      rows.push(text);
    } else rows[rows.length - 1] = row ? `${row}  ${text}` : text;
  }
  return rows;
}

function Box({ graph, nth, is_chosen, choose }) {
  const box = graph.boxes[nth];
  const state = state_of(box, known);
  const [x, y, width, height] = [box.place[0] * WIDE, box.place[1] * HIGH, box.place[2] * WIDE, box.place[3] * HIGH];
  const words = why_absent(graph, nth, known);
  const fits = (text) => (text.length * 6.6 > width - 16 ? `${text.slice(0, Math.floor((width - 16) / 6.6) - 1)}…` : text);
  const room = Math.floor((height - 12) / LINE) - 1;
  const about = box.lines.slice(0, Math.max(0, room - 2));
  const lines = [...about.map((text) => ["muted", fits(text)]), ...values(state.names, Math.floor(width / 6.6) - 3, Math.max(1, room - about.length - 1)).map((text) => ["value", text])];
  const age = words ? fits(words) : state.age === null ? "" : `age ${lasting(state.age)}`;
  const press = (event) => (event.key === "Enter" || event.key === " ") && (event.preventDefault(), choose(nth));
  return (
    <g class={`box ${box.class ?? ""} ${state.kind}${is_chosen ? " chosen" : ""}`} transform={`translate(${x} ${y})`} tabindex="0" role="button"
      aria-pressed={is_chosen} aria-label={`${box.name}, ${box.kind ?? box.class}: ${words ?? `${state.there} of ${state.of} values`}`} onClick={() => choose(nth)} onKeyDown={press}>
      <rect width={width} height={height} rx={box.class === "signal" ? 16 : 6} />
      <text class="name" x="9" y="18">{MARKS[state.kind]}{fits(box.name)}</text>
      {lines.map(([kind, text], row) => <text key={row} class={kind} x="9" y={18 + LINE * (row + 1)}>{text}</text>)}
      {age && <text class={words ? "reason" : "muted"} x="9" y={height - 7}>{age}</text>}
    </g>
  );
}

/** All that a node gives. */
function Node({ graph, nth, close }) {
  const box = graph.boxes[nth];
  const words = why_absent(graph, nth, known);
  const main = new Set(main_channels(box));
  const of = (known.nodes?.nodes ?? []).filter((node) => box.nodes.includes(node.node));
  const drawn = [...main].slice(0, CURVES);
  useEffect(() => drawn.forEach((name) => ring.want(name)), [nth]);
  const held = known.axes ? known.axes.axes.filter((axis) => axis.why && axis.channels?.why?.some((name) => box.channels.includes(name))) : [];
  return (
    <div class="tile node" role="group" aria-label={`Node ${box.name}`}>
      <p><b>{box.name}</b> <span class="muted">{box.kind ?? box.class}</span> <button type="button" onClick={close}>Close</button></p>
      {words && <p class="bad">{words}</p>}
      {held.map((axis) => <p key={axis.axis} class="bad">{axis.axis}: {axis.why}</p>)}
      {of.filter((node) => node.novelty != null).map((node) => (
        <p key={node.node} class={node.novelty > 1 ? "bad" : ""}>{node.node}: novelty {figure(node.novelty)}{node.novelty > 1 ? ", outside of its fit" : ""}</p>
      ))}
      <Plot name={`What ${box.name} gives`} lines={coloured(drawn, (name) => name)} unit={unit_of(drawn[0])} height={180} />
      <div class="wide tall" tabIndex={0} role="region" aria-label={`What ${box.name} gives`}>
        <table>
          <thead><tr><th scope="col">channel</th><th scope="col">value</th><th scope="col">age</th><th scope="col" class="left">last value</th></tr></thead>
          <tbody>
            {[...box.channels].sort((a, b) => main.has(b) - main.has(a)).map((name) => {
              const [value, at] = [counts(name), known.seen.get(name)?.at];
              return (
                <tr key={name} class={value == null && main.has(name) ? "faulty" : ""}>
                  <th scope="row">{name}</th>
                  <td>{value == null ? "absent" : figure(value, 6)} {unit_of(name)}</td>
                  <td>{at === undefined ? ABSENT : lasting(known.tick.time_s - at)}</td>
                  <td class="left">{at === undefined ? "none since this page was opened" : clock(at)}</td>
                </tr>
              );
            })}
          </tbody>
        </table>
      </div>
      {of.flatMap((node) => node.errors).map((error) => (
        <p key={error.prediction} class="muted">{error.prediction}: root mean square error {figure(error.rmse)} {error.unit} over the last hours</p>
      ))}
    </div>
  );
}
