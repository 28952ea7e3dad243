// The plant of server.py, as far as tests of both need it, by another make of OPC UA: node-opcua.
"use strict";

const readline = require("readline");
const opcua = require("node-opcua");

// Whatever the library prints is no answer.
console.log = console.warn = console.error;
const answer = (of) => process.stdout.write(`${JSON.stringify(of || {})}\n`);
const options = {};
for (let nth = 2; nth < process.argv.length; nth += 2) options[process.argv[nth].slice(2)] = process.argv[nth + 1];

async function main() {
  const server = new opcua.OPCUAServer({
    port: Number(options.port),
    hostname: "127.0.0.1",
    alternateHostname: ["127.0.0.1"],
    serverCertificateManager: new opcua.OPCUACertificateManager({
      rootFolder: options.folder, automaticallyAcceptUnknownCertificate: true,
    }),
    securityPolicies: [opcua.SecurityPolicy.None, opcua.SecurityPolicy.Basic256Sha256],
    securityModes: [opcua.MessageSecurityMode.None, opcua.MessageSecurityMode.SignAndEncrypt],
  });
  await server.initialize();
  const space = server.engine.addressSpace;
  // So that its number is not that of the other server.
  space.registerNamespace("urn:before");
  const plant = space.registerNamespace("urn:plant");
  const folder = plant.addObject({ organizedBy: space.rootFolder.objects, browseName: "Therm", nodeId: "s=Therm" });
  const nodes = {};
  const orders = {
    add: ({ name, kind, value }) => {
      const dataType = opcua.DataType[kind];
      nodes[name] = plant.addVariable({
        componentOf: folder, browseName: name, nodeId: `s=${name}`, dataType: kind, accessLevel: "CurrentRead | CurrentWrite",
        userAccessLevel: "CurrentRead | CurrentWrite", value: { dataType, value },
      });
    },
    write: ({ name, value, status, at }) => {
      const node = nodes[name];
      const dataType = node.readValue().value.dataType;
      const code = status ? opcua.coerceStatusCode(status) : opcua.StatusCodes.Good;
      node.setValueFromSource({ dataType, value }, code, at ? new Date(at * 1000) : new Date());
    },
    read: ({ name }) => {
      const { value } = nodes[name].readValue();
      return { value: value.value, type: opcua.DataType[value.dataType] };
    },
  };
  orders.add({ name: "Therm.0", kind: "Double", value: 0 });
  await server.start();
  answer({ ready: Date.now() / 1000 });
  for await (const line of readline.createInterface({ input: process.stdin })) {
    const order = JSON.parse(line);
    answer(orders[order.do](order));
  }
  process.exit();
}

main();
