// Orders: with the token, typed once for a tab, and to the revision that the page shows.

import { useEffect, useReducer, useRef } from "preact/hooks";
import { post, token } from "./link.js";
import { changed, known, refresh } from "./store.js";

/** What is asked of whoever stands there; one thing at a time. */
let asked = null;

function ask(question) {
  asked?.answer(null);
  return new Promise((answer) => {
    asked = { ...question, answer: (value) => ((asked = null), changed(true), answer(value)) };
    changed(true);
  });
}

/** Asks for a token; none where that is called off. */
export async function ask_token(why) {
  const text = await ask({ kind: "token", why });
  if (text) {
    token.set(text);
    known.needs_token = false;
  }
  return Boolean(text);
}

/** Asks whether something that changes the machine is meant. */
export const sure = (words, verb) => ask({ kind: "sure", words, verb });

/** Gives an order. What it answers, or `{ refused }` with the reason, and nothing where it was called off. */
export async function order(path, body) {
  if (!token.get() && !(await ask_token("Orders need the token of the service: it stands in the file `token` of its state folder."))) return null;
  for (let tries = 0; ; tries += 1) {
    try {
      const answer = await post(path, body, known.status?.revision);
      await refresh();
      return answer;
    } catch (refused) {
      if (refused.status === 401 || (refused.status === 403 && /token/.test(refused.message))) {
        if (refused.status === 401) token.forget();
        if (await ask_token(`The token was refused: ${refused.message}.`)) continue;
        return null;
      }
      if (refused.status === 503 && tries < 5) {
        await new Promise((done) => setTimeout(done, (refused.again_s ?? 1) * 1000));
        continue;
      }
      if (refused.status === 409) refresh();
      return { refused };
    }
  }
}

/** The dialog in which that is answered. */
export function Questions() {
  const place = useRef(null);
  const field = useRef(null);
  const of = asked;
  useEffect(() => {
    if (of && !place.current.open) {
      place.current.showModal();
      field.current?.focus();
    } else if (!of && place.current.open) place.current.close();
  }, [of]);
  const answered = (event) => {
    event.preventDefault();
    const text = field.current?.value?.trim();
    if (of.kind === "token" && !text) return;
    of.answer(of.kind === "token" ? text : true);
  };
  return (
    <dialog ref={place} aria-labelledby="question" onCancel={() => of?.answer(null)}>
      {of && (
        <form method="dialog" onSubmit={answered} autocomplete="off">
          <h2 id="question">{of.kind === "token" ? "Token" : "Are you sure?"}</h2>
          <p>{of.kind === "token" ? of.why : of.words}</p>
          {of.kind === "token" && (
            <p><label>Token <input ref={field} type="password" autocomplete="off" spellcheck={false} /></label>
              <span class="muted"> It is kept for this tab alone.</span></p>
          )}
          <p class="times">
            <button type="submit" class="main">{of.kind === "token" ? "Use it" : of.verb}</button>
            <button type="button" onClick={() => of.answer(null)}>Cancel</button>
          </p>
        </form>
      )}
    </dialog>
  );
}

/** Whether this tab has a token, and what takes it away. */
export function Token() {
  const [, again] = useReducer((n) => n + 1, 0);
  if (!token.get()) return <button type="button" class="screen" onClick={() => ask_token("The token of the service: it stands in the file `token` of its state folder.").then(again)}>Token …</button>;
  return <button type="button" class="screen" onClick={() => (token.forget(), again())}>Forget the token</button>;
}
