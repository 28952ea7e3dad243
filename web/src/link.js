// How the service is asked: answers, orders with the token of this tab, and the stream of ticks and events.

const KEY = "athermal-token";

/** Why something was refused: its status, its sentence, and all that came with it. */
export class Refused extends Error {
  constructor(status, words, body = {}, again_s = null) {
    super(words);
    Object.assign(this, { status, body, again_s });
  }
}

/** The token, typed once for a tab and kept nowhere else. */
export const token = {
  get: () => sessionStorage.getItem(KEY),
  set: (text) => sessionStorage.setItem(KEY, text.trim()),
  forget: () => sessionStorage.removeItem(KEY),
};

/** Headers with the token, if it can stand in one at all. */
function headers(more) {
  const text = token.get();
  const sendable = text && /^[\x21-\x7e]+$/.test(text);
  return sendable ? { ...more, Authorization: `Bearer ${text}` } : { ...more };
}

async function refusal(answer) {
  const text = await answer.text().catch(() => "");
  let body = {};
  try {
    body = JSON.parse(text);
  } catch {
    // A proxy answers in its own words.
  }
  const words = typeof body.error === "string" ? body.error : `the service answers ${answer.status} ${answer.statusText}`;
  const again = Number(answer.headers.get("Retry-After"));
  return new Refused(answer.status, words, body, answer.headers.has("Retry-After") && again >= 0 ? again : null);
}

async function ask(path, options, patience_s) {
  let answer;
  try {
    answer = await fetch(path, { cache: "no-store", credentials: "omit", signal: AbortSignal.timeout(patience_s * 1000), ...options });
    if (answer.ok) return await answer.json();
  } catch (error) {
    const words = error.name === "TimeoutError" ? `no answer within ${patience_s} s` : "no connection to the service";
    throw new Refused(0, words);
  }
  throw await refusal(answer);
}

/** How many questions of a page may be under way: 64 pages are to leave room at the service. */
let free = 2;
const waiting = [];

/** What a path of the service answers. */
export async function get(path, patience_s = 4) {
  if (free > 0) free -= 1;
  else await new Promise((begin) => waiting.push(begin));
  try {
    return await ask(path, { headers: headers() }, patience_s);
  } finally {
    const next = waiting.shift();
    if (next) next();
    else free += 1;
  }
}

/** An order, to what the page shows to be running: another revision by now is refused. */
export function post(path, body, revision) {
  const known = revision ? { "If-Match": `"${revision}"` } : {};
  const options = { method: "POST", headers: headers({ "Content-Type": "application/json", ...known }) };
  return ask(path, { ...options, body: JSON.stringify(body ?? {}) }, 60);
}

/** Ticks and events as they come, until the service or the signal ends them. */
export async function listen(path, signal, heard) {
  const answer = await fetch(path, { headers: headers(), cache: "no-store", credentials: "omit", signal });
  if (!answer.ok) throw await refusal(answer);
  const reader = answer.body.getReader();
  const letters = new TextDecoder();
  const parse = messages(heard);
  heard("alive", null);
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    parse(letters.decode(value, { stream: true }));
  }
}

/** Cuts a stream of server-sent events into messages. */
export function messages(heard) {
  let rest = "";
  return (text) => {
    rest += text;
    let end;
    while ((end = rest.indexOf("\n\n")) >= 0) {
      const block = rest.slice(0, end);
      rest = rest.slice(end + 2);
      let [event, data] = ["alive", ""];
      for (const line of block.split("\n")) {
        if (line.startsWith("event: ")) event = line.slice(7);
        else if (line.startsWith("data: ")) data += line.slice(6);
      }
      let facts = null;
      try {
        facts = data ? JSON.parse(data) : null;
      } catch {
        // Cut short; the next one is whole again.
        continue;
      }
      heard(event, facts);
    }
  };
}
