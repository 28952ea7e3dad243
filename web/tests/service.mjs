// A service that runs, fed as a machine feeds it: ten rows a second, of now.

import { execFile, spawn } from "node:child_process";
import { once } from "node:events";
import { closeSync, mkdtempSync, openSync, readFileSync, rmSync, writeFileSync, writeSync } from "node:fs";
import { createServer, connect } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { promisify } from "node:util";

export const athermal = process.env.ATHERMAL;
export const AXES = ["X1", "Y1", "Z1", "X2", "Y2", "Z2"];
const TEMPERATURES = ["plate1", "holder1", "plate2", "holder2", "room", "chuck"];
const HEAD = ["time_s", ...TEMPERATURES.map((of) => `temperature.${of}`), ...AXES.map((of) => `position.${of}`), ...AXES.map((of) => `applied.${of}`)].join(",");
/** What would run if the page took it for anything but a text. */
export const SCRIPT = "<img src=x onerror=window.hurt=1>";

const each = (kind, unit, channels) => `[signals.${kind}]\nunit = "${unit}"\nchannels = ${channels}\ncolumn = "${kind}.{channel}"\nmax_age = "3s"\n`;

/** Six axes that drift with six temperatures, predicted, corrected, graded. */
export const graph = (memory = "1min", name = "die-tester") => `schema = 1
name = "${name}"
time = { column = "time_s", unit = "s" }
sets.axis = ${JSON.stringify(AXES)}
${each("temperature", "Cel", JSON.stringify(TEMPERATURES))}
${each("position", "nm", '"axis"')}
${each("applied", "nm", '"axis"')}
[nodes]
uncorrected = { type = "uncorrected", inputs = { position = "position", applied = "applied" }, until_first = "zero" }
drift = { type = "slope", inputs.signal = "uncorrected", windows = ["4s"], unit = "nm/min" }
residual = { type = "slope", inputs.signal = "position", windows = ["4s"], unit = "nm/min" }
gradients = { type = "slope", inputs.signal = "temperature", windows = ["3s", "9s"], unit = "mK/min" }
thermal = { type = "linear", each = "axis", inputs = { features = "gradients", truth = "drift.{axis}" }, ahead = "2s" }
motion = { type = "ar", each = "axis", inputs.truth = "drift.{axis}", ahead = "2s", lags = ["2s", "4s"] }
vote = { type = "auto_weighted", each = "axis", inputs = { voters = ["thermal.{axis}", "motion.{axis}"], truth = "drift.{axis}" }, memory = "${memory}" }
compensate = { type = "compensate", inputs.rate = { from = "vote", max_age = "2s" }, range = "200 um", max_rate = "2000 nm/min", max_slew = "50 nm/s" }
stability = { type = "stability", inputs.drift = "residual", stable_below = "30 nm/min", transient_above = "80 nm/min", hysteresis = "5 nm/min", dwell = "2s" }
[outputs]
drift = "drift"
predicted = "vote"
left = "residual"
correction = "compensate"
why = "compensate:why"
state = "stability"
`;

/** A source that is never there, which a service is degraded by. */
const AWAY = `[sources.other]
type = "csv"
path = "absent.csv"
channels = ["applied"]
silent = "1 s"
`;

const machine = (port, secure, more) => `schema = 1
extends = "graph.toml"
model = "model.json"
runtime = { wait = "0 s", settle = "0 s" }
[sources.logger]
type = "csv"
path = "live.csv"
[sinks.history]
type = "csv"
path = "history.csv"
[control]
http = "127.0.0.1:${port}"
https = { at = "127.0.0.1:${secure}" }
[page]
drift = "drift"
left = "left"
[alarms.warm]
of = "temperature.plate1"
above = "20 Cel"
text = "plate1 is warm${more}"
`;

/** A row of an instant. The same instant gives the same row. */
export function row(time) {
  let seed = (Math.imul(Math.round(time * 10), 2654435761) >>> 1) % 2147483647 || 1;
  const noise = () => ((seed = (seed * 48271) % 2147483647) / 2147483647) - 0.5;
  const warmth = TEMPERATURES.map((_, nth) => 25 + nth + 2 * Math.sin(time / (20 + 5 * nth)) + 0.5 * Math.sin(time / 7 + nth) + 0.002 * noise());
  const drifts = AXES.map((_, nth) => 20 * (nth + 1) * Math.sin(time / (20 + 5 * nth) - 0.1));
  // A correction takes most of it away.
  const applied = drifts.map((of) => -0.9 * of);
  const places = drifts.map((of, nth) => of + applied[nth] + noise());
  return [time, ...warmth, ...places, ...applied].map((of) => of.toFixed(5)).join(",");
}

const run = promisify(execFile);

export async function free_port() {
  const server = createServer().listen(0, "127.0.0.1");
  await once(server, "listening");
  const { port } = server.address();
  server.close();
  await once(server, "close");
  return port;
}

/** The same graph with another memory, fitted: a model that can take over. */
async function fit(folder, name, memory, more) {
  writeFileSync(join(folder, `${name}.toml`), graph(memory, `die-tester${more}`));
  await run(athermal, ["fit", `${name}.toml`, "--data", "train.csv", "-o", `${name}.json`, "--quiet"], { cwd: folder });
  return readFileSync(join(folder, `${name}.json`), "utf8");
}

/** Starts a service and feeds it; `feeding` may be set to false. One of its sources may be away, and its names may have `more` in them. */
export async function serve({ is_away = false, more = "" } = {}) {
  const folder = mkdtempSync(join(tmpdir(), "athermal-page-"));
  const rows = Array.from({ length: 1500 }, (_, nth) => row(1.7e9 + nth / 10));
  writeFileSync(join(folder, "train.csv"), `${[HEAD, ...rows].join("\n")}\n`);
  writeFileSync(join(folder, "model.json"), await fit(folder, "graph", "1min", more));
  const other = await fit(folder, "other", "30s", more);
  const [port, secure] = [await free_port(), await free_port()];
  writeFileSync(join(folder, "machine.toml"), await read_by(folder, is_away ? lacking(machine(port, secure, more)) : machine(port, secure, more)));
  const live = openSync(join(folder, "live.csv"), "a");
  // What came before the page was opened: it is there at once.
  const now = Date.now() / 1000;
  writeSync(live, `${[HEAD, ...Array.from({ length: 300 }, (_, nth) => row(now - 30 + nth / 10))].join("\n")}\n`);
  const service = { folder, port, other, secure: `https://127.0.0.1:${secure}/`, feeding: true, url: `http://127.0.0.1:${port}/` };
  const feed = setInterval(() => service.feeding && writeSync(live, `${row(Date.now() / 1000)}\n`), 100);
  let child;
  let log = "";
  service.log = () => log;
  const ticks = () => fetch(`${service.url}v1/status`).then((of) => of.json()).then((of) => of.happenings, () => 0);
  service.start = async () => {
    log = "";
    child = spawn(athermal, ["serve", "machine.toml", "--state", "state"], { cwd: folder, stdio: ["ignore", "ignore", "pipe"] });
    child.stderr.on("data", (text) => (log += text));
    service.pid = child.pid;
    for (let tries = 0; (await ticks()) <= (is_away ? 0 : 200); tries += 1) {
      if (child.exitCode !== null && /has no TLS/.test(log)) {
        writeFileSync(join(folder, "machine.toml"), readFileSync(join(folder, "machine.toml"), "utf8").replace(/^https = .*\n/m, ""));
        service.secure = null;
        return service.start();
      }
      if (tries > 300 || child.exitCode !== null) {
        await service.stop();
        throw new Error(`the service gave no ticks: ${log}`);
      }
      await new Promise((done) => setTimeout(done, 100));
    }
    return service;
  };
  service.kill = async () => {
    if (child.exitCode !== null || child.signalCode !== null) return;
    const over = once(child, "exit");
    child.kill("SIGKILL");
    await over;
  };
  service.stop = async () => {
    clearInterval(feed);
    closeSync(live);
    await service.kill();
    rmSync(folder, { recursive: true, force: true });
  };
  await service.start();
  service.token = readFileSync(join(folder, "state", "token"), "utf8").trim();
  return service;
}

const lacking = (text) => text.replace('path = "live.csv"\n', `path = "live.csv"\nchannels = ["temperature", "position"]\n${AWAY}`);

/** A machine file without what a program was built without: TLS, alarms. */
async function read_by(folder, text) {
  const without_tls = text.replace(/^https = .*\n/m, "");
  for (const tried of [text, without_tls]) {
    writeFileSync(join(folder, "machine.toml"), tried);
    if (await run(athermal, ["check", "machine.toml"], { cwd: folder }).then(() => true, () => false)) return tried;
  }
  return without_tls.slice(0, text.indexOf("[alarms."));
}

/** What stands between the page and the service, and can be cut. */
export async function between(port) {
  const sockets = new Set();
  const server = createServer((socket) => {
    const to = connect(port, "127.0.0.1");
    for (const end of [socket, to]) {
      sockets.add(end);
      end.on("error", () => {}).on("close", () => (sockets.delete(end), socket.destroy(), to.destroy()));
    }
    socket.pipe(to).pipe(socket);
  });
  const open = async (at) => {
    server.listen(at, "127.0.0.1");
    await once(server, "listening");
  };
  await open(0);
  const { port: own } = server.address();
  const cut = () => (server.close(), sockets.forEach((socket) => socket.destroy()));
  return { url: `http://127.0.0.1:${own}/`, cut, mend: () => open(own) };
}
