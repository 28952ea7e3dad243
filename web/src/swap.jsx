// Another graph or model: read, compared in the shadow of what runs, let take over, taken back.

import { useRef, useState } from "preact/hooks";
import { order, sure } from "./orders.jsx";
import { Comparison } from "./shadow.jsx";
import { known } from "./store.js";
import { counted, lasting, plain, short } from "./words.js";

/** How many letters a text that is uploaded may have to be shown. */
const SHOWN = 200_000;

/** A model is JSON, a graph is not. */
const kind_of = (text) => (text.trimStart().startsWith("{") ? "model" : "graph");

export function Swap() {
  const [text, write] = useState("");
  const [said, say] = useState(null);
  const [busy, work] = useState("");
  const [shadow, set_shadow] = useState({ duration: "30min", margin: "2", commit: false });
  const field = useRef(null);
  const of = known.status;
  if (!of) return null;
  const give = async (words, path, body) => {
    work(words);
    say(null);
    const answer = await order(path, body);
    work("");
    if (answer) say(answer.refused ? { refused: answer.refused } : { done: words, answer });
    return answer;
  };
  const ask = async (question, verb, words, path) => (await sure(question, verb)) && give(words, path);
  const upload = async (event) => {
    const picker = event.currentTarget;
    const [file] = picker.files;
    if (file) write(await file.text());
    picker.value = "";
  };
  const go_to = ({ line, column }) => {
    const at = text.split("\n").slice(0, line - 1).reduce((sum, row) => sum + row.length + 1, 0) + column - 1;
    field.current.focus();
    field.current.setSelectionRange(at, at);
    field.current.scrollTop = Math.max(0, (line - 4) * 20);
  };
  const compare = () => give("is compared", "/v1/shadow", { duration: shadow.duration, margin: Number(shadow.margin) / 100, commit: shadow.commit });
  const set = (more) => set_shadow({ ...shadow, ...more });
  return (
    <section aria-labelledby="swap" class="screen">
      <h2 id="swap">Swap</h2>
      <p>
        <b>{short(of.revision)}</b> runs{of.staged ? <>, <b>{short(of.staged.revision)}</b> is staged</> : ""}
        {of.previous ? <>, <b>{short(of.previous)}</b> can be taken back</> : ""}{of.frozen ? "; learning is frozen" : ""}.
      </p>
      <label class="field">Graph or model
        <textarea ref={field} value={text.length > SHOWN ? "" : text} rows={8} spellcheck={false} placeholder={text.length > SHOWN ? `A ${kind_of(text)} of ${counted(text.length, "letter")}` : "Paste a graph (TOML) or a model (JSON)"} onInput={(event) => write(event.currentTarget.value)} />
      </label>
      <div class="times">
        <label class="file">Or a file <input type="file" accept=".toml,.json" onChange={upload} /></label>
        <button type="button" class="main" disabled={!text.trim() || busy} onClick={() => give("is staged", "/v1/stage", { [kind_of(text)]: text })}>Stage this {kind_of(text)}</button>
        <button type="button" disabled={Boolean(busy)} onClick={() => give("is staged", "/v1/stage", {})}>Stage the machine file</button>
      </div>
      <div role="status" aria-live="polite">
        {busy && <p class="muted">Asking the service …</p>}
        {said && <Said said={said} go_to={go_to} />}
      </div>
      {of.staged && <Carried staged={of.staged} />}
      {of.staged && (
        <div class="times" role="group" aria-label="What is staged">
          <label>Compare for <input size={6} value={shadow.duration} onInput={(event) => set({ duration: event.currentTarget.value })} /></label>
          <label>margin <input size={4} inputMode="decimal" value={shadow.margin} onInput={(event) => set({ margin: event.currentTarget.value })} /> %</label>
          <label><input type="checkbox" checked={shadow.commit} onChange={(event) => set({ commit: event.currentTarget.checked })} /> then commit</label>
          <button type="button" disabled={Boolean(busy)} onClick={compare}>Compare in the shadow</button>
          <button type="button" class="main" disabled={Boolean(busy)}
            onClick={() => ask(`${short(of.staged.revision)} takes over from ${short(of.revision)} before the next tick.`, "Commit", "takes over", "/v1/commit")}>Commit</button>
          <button type="button" disabled={Boolean(busy)} onClick={() => give("was let go", "/v1/discard")}>Discard</button>
        </div>
      )}
      <Comparison verdict={of.verdict} staged={of.staged?.revision} />
      <div class="times" role="group" aria-label="What runs">
        <button type="button" disabled={!of.previous || Boolean(busy)}
          onClick={() => ask(`${short(of.previous)} takes over again from ${short(of.revision)}.`, "Roll back", "is taken back", "/v1/rollback")}>Roll back</button>
        {of.frozen ? <button type="button" disabled={Boolean(busy)} onClick={() => give("learning goes on", "/v1/thaw")}>Thaw learning</button>
          : <button type="button" disabled={Boolean(busy)} onClick={() => give("learning is frozen", "/v1/freeze")}>Freeze learning</button>}
        <button type="button" disabled={Boolean(busy)} onClick={() => give("a checkpoint is taken", "/v1/snapshot")}>Take a checkpoint</button>
      </div>
    </section>
  );
}

/** What the service said to an order. */
function Said({ said, go_to }) {
  if (said.refused) {
    const { message, status, body } = said.refused;
    return (
      <div class="refused">
        <p class="bad"><b>{status === 409 ? "Not now: " : "Refused: "}{message}</b>{status === 409 ? " What is shown has been asked for again." : ""}</p>
        {body.diagnostics?.length > 0 && (
          <ul>
            {body.diagnostics.map((of, nth) => (
              <li key={nth} class={of.severity === "error" ? "bad" : ""}>
                {of.line ? <button type="button" class="place" onClick={() => go_to(of)}>line {of.line}:{of.column}</button> : null} {of.code} {of.message}
                {of.help ? <span class="muted"> {of.help}</span> : ""}
              </li>
            ))}
          </ul>
        )}
        {body.text && <pre class="wide" tabIndex={0}>{body.text}</pre>}
      </div>
    );
  }
  const { answer } = said;
  return (
    <div>
      <p class="good"><b>Done: {answer.revision ? `${short(answer.revision)} ` : ""}{said.done}.</b></p>
      {answer.carried !== undefined && (
        <ul>
          <li>{counted(answer.carried, "node")} of {answer.nodes.length} {answer.carried === 1 ? "goes" : "go"} on as they were; it was warmed by {lasting(answer.past_s)} of the past.</li>
          {answer.silent?.length > 0 && <li class="bad">Without a value over that past: {answer.silent.join(", ")}</li>}
          {answer.endless?.length > 0 && <li>These go by all of their past: {answer.endless.join(", ")}</li>}
        </ul>
      )}
      {answer.doubts && <pre class="wide" tabIndex={0}>{answer.doubts}</pre>}
    </div>
  );
}

/** What becomes of each node. */
function Carried({ staged }) {
  const kinds = new Map();
  for (const { node, carry, ...more } of staged.nodes) {
    const why = Object.values(more).filter((value) => typeof value === "string").join(", ");
    kinds.set(carry, [...(kinds.get(carry) ?? []), why ? `${node} (${why})` : node]);
  }
  return (
    <details open>
      <summary>What becomes of the {staged.nodes.length} nodes</summary>
      <dl class="carry">
        {[...kinds].map(([carry, nodes]) => (
          <div key={carry}><dt>{plain(carry)}: {nodes.length}</dt><dd>{nodes.join(", ")}</dd></div>
        ))}
      </dl>
    </details>
  );
}
