// The page of a running service: is it right now, may one measure, what moved, why did it stop correcting?

import { render } from "preact";
import { useEffect, useReducer } from "preact/hooks";
import { Alarms } from "./alarms.jsx";
import { Drift } from "./drift.jsx";
import { Events } from "./events.jsx";
import { Graph } from "./graph.jsx";
import { ask_token, Questions, Token } from "./orders.jsx";
import { Part } from "./part.jsx";
import { Seen } from "./seen.jsx";
import { Sensors, Sources } from "./sensors.jsx";
import { known, on_change, start } from "./store.js";
import { Swap } from "./swap.jsx";
import { Axes, Doubts, Parts } from "./top.jsx";
import { on_view } from "./view.js";
import { Contributions, Votes } from "./votes.jsx";
import { clock } from "./words.js";

function Page() {
  const [, again] = useReducer((n) => n + 1, 0);
  useEffect(() => {
    const [no_change, no_view] = [on_change(again), on_view(again)];
    return () => (no_change(), no_view());
  }, []);
  useEffect(() => {
    if (known.needs_token) ask_token(NEEDED);
  }, [known.needs_token]);
  const of = known.status;
  useEffect(() => {
    document.title = of ? `${of.name}: ${STATES[state] ?? state}` : "athermal";
  });
  const state = known.found[0]?.kind ?? (of ? of.state : "asking");
  return (
    <>
      <a class="skip" href="#drift">To the curves</a>
      <header>
        <h1>{of ? of.name : "athermal"}</h1>
        <span class={`state ${state}`}>{STATES[state] ?? state}</span>
        <span class="muted">{known.tick ? `tick of ${clock(known.tick.time_s)}` : "no tick yet"}</span>
        <Token />
      </header>
      <main>
        <Part name="What is in doubt"><Doubts /></Part>
        {known.needs_token && <p class="doubt">Nothing is shown without a token. <button type="button" onClick={() => ask_token(NEEDED)}>Type it</button></p>}
        {known.problems.status && !known.needs_token && <p class="bad">The status is not known: {known.problems.status}; asked for again.</p>}
        <Part name="How the axes are"><Axes /></Part>
        <Part name="The state"><Parts /></Part>
        <Part name="The drift"><Drift /></Part>
        <div class="side">
          <div>
            <Part name="The sources"><Sources /></Part>
            <Part name="The sensors"><Seen>{() => <Sensors />}</Seen></Part>
          </div>
          <Part name="The alarms"><Alarms /></Part>
        </div>
        <Part name="The graph"><Graph /></Part>
        <Part name="The votes"><Seen>{() => <Votes />}</Seen></Part>
        <Part name="What a prediction is made of"><Contributions /></Part>
        <Part name="The swap"><Swap /></Part>
        <Part name="What happened"><Seen>{() => <Events />}</Seen></Part>
      </main>
      <Questions />
    </>
  );
}

const NEEDED = "This service shows what it knows to those alone who have a token: it stands in the file `token-read` or `token` of its state folder.";
const STATES = { running: "running", lost: "no connection", no_tick: "no ticks", behind: "behind", degraded: "degraded", asking: "asking" };

start();
const place = document.getElementById("page");
place.textContent = "";
render(<Page />, place);
