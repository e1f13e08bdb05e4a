// The client of @foxglove/ws-protocol: subscribes to every channel, prints what it is told as JSON lines, and does what
// it reads: {"do": "getParameters", "with": [[], "id"]} calls that method of the client.
import { createInterface } from "node:readline";
import protocol from "@foxglove/ws-protocol";
import { WebSocket } from "ws";

const [url, subprotocol] = process.argv.slice(2);
const socket = new WebSocket(url, [subprotocol]);
const client = new protocol.FoxgloveClient({ ws: socket });
const base64 = (view) => Buffer.from(view.buffer, view.byteOffset, view.byteLength).toString("base64");
const topics = new Map();
const told = (event, value) => process.stdout.write(JSON.stringify({ event, value }) + "\n");

client.on("open", () => told("open", socket.protocol));
client.on("close", (event) => { told("close", event.code); process.exit(0); });
client.on("error", (error) => told("error", String(error)));
for (const name of ["serverInfo", "status", "removeStatus", "unadvertise", "parameterValues", "advertiseServices",
  "unadvertiseServices", "connectionGraphUpdate", "serviceCallFailure"]) {
  client.on(name, (value) => told(name, value));
}
client.on("advertise", (channels) => {
  told("advertise", channels);
  for (const channel of channels) {
    topics.set(client.subscribe(channel.id), channel.topic);
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) =>
  told("message", [topics.get(subscriptionId), String(timestamp), base64(data)]));
client.on("time", ({ timestamp }) => told("time", String(timestamp)));
client.on("serviceCallResponse", ({ callId, data }) => told("serviceCallResponse", [callId, base64(data)]));

createInterface({ input: process.stdin }).on("line", (line) => {
  const { do: name, with: values } = JSON.parse(line);
  if (name === "call") {
    const [serviceId, callId, data] = values;
    client.sendServiceCallRequest({ serviceId, callId, encoding: "ros1", data: new DataView(
      Uint8Array.from(Buffer.from(data, "base64")).buffer) });
  } else {
    client[name](...values);
  }
});
