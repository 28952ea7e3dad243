// An edge node for tests: sparkplug-client, which does what stands on its standard input, a JSON object a line, and answers with one.
//
// --store: it keeps what it cannot publish to the primary host `athermal`, and sends it after a birth once that is there.
// --slow: it is born only when it is asked, and a second later.
"use strict";

const mqtt = require("mqtt");
const readline = require("readline");
const sparkplug = require("sparkplug-client");

const [port, ...options] = process.argv.slice(2);
const [stores, isSlow] = ["--store", "--slow"].map((of) => options.includes(of));
const url = `mqtt://127.0.0.1:${port}`;
const edge = sparkplug.newClient({
  serverUrl: url, username: "edge", password: "edge", groupId: "plant", edgeNode: "edge", clientId: `edge-${process.pid}`,
});
// Of its own, since STATE is no message of Sparkplug's own form.
const watch = mqtt.connect(url);

const seen = { births: 0, asked: 0, states: [] };
let [last, isOnline, stored] = [[20, Date.now()], !stores, []];

const metric = (name, alias, [value, timestamp], more) => ({ name, alias, value, timestamp, type: "Double", ...more });

function birth() {
  seen.births += 1;
  const timestamp = Date.now();
  const rebirth = { name: "Node Control/Rebirth", type: "Boolean", value: false };
  edge.publishNodeBirth({ timestamp, metrics: [metric("T", 7, last), rebirth] });
  edge.publishDeviceBirth("d", { timestamp, metrics: [metric("A/B", 8, last)] });
}

// By its alias alone.
function data(sample, more) {
  edge.publishNodeData({ timestamp: Date.now(), metrics: [metric(undefined, 7, sample, more)] });
}

function hear(is) {
  if (is && !isOnline) {
    isOnline = true;
    birth();
    stored.splice(0).forEach((of) => data(of, { isHistorical: true }));
  } else if (!is && isOnline) {
    isOnline = false;
    edge.publishNDeath(edge.client);
  }
}

edge.on("ncmd", () => {
  seen.asked += 1;
  if (isSlow) setTimeout(birth, 1000);
  else if (isOnline) birth();
});

watch.on("message", (topic, payload) => {
  const said = JSON.parse(payload);
  const host = topic.split("/")[2];
  seen.states.push({ host, ...said });
  if (stores && host === "athermal") hear(said.online);
});

const orders = {
  data: ({ value, device }) => {
    last = [value, Date.now()];
    if (device) edge.publishDeviceData(device, { timestamp: last[1], metrics: [metric(undefined, 8, last)] });
    else if (isOnline) data(last);
    else stored.push(last);
  },
  birth,
  unknown: () => edge.publishNodeData({ timestamp: Date.now(), metrics: [metric(undefined, 99, last)] }),
  packed: () => edge.publishNodeData({ timestamp: Date.now(), metrics: [metric(undefined, 7, last)] }, { compress: true }),
  // Of a message that nobody got.
  skip: () => { edge.seq = (edge.seq + 1) % 256; },
  look: () => ({ ...seen, isOnline, stored: stored.length }),
  publish: ({ topic, text }) => { watch.publish(topic, text, { qos: 1, retain: true }); },
  // Another client with an id, for a moment.
  steal: ({ id }) => {
    const thief = mqtt.connect(url, { clientId: id, reconnectPeriod: 0 });
    thief.on("connect", () => thief.end());
  },
};

readline.createInterface({ input: process.stdin }).on("line", (line) => {
  const order = JSON.parse(line);
  console.log(JSON.stringify(orders[order.do](order) || {}));
}).on("close", () => process.exit());

watch.on("connect", () => watch.subscribe("spBv1.0/STATE/+", { qos: 1 }, () => {
  const begin = () => {
    if (isOnline && !isSlow) birth();
    console.log("ready");
  };
  if (edge.connected) begin();
  else edge.on("birth", begin);
}));
