// SPDX-License-Identifier: GPL-3.0-or-later
// Subscribes to every channel of a server by npm's @foxglove/ws-protocol. Prints the line `reads` at the first message.
// After COUNT messages of the channel of r4.Record, prints a JSON object: the channels, and the messages of each channel
// as [nanoseconds, object]. Usage, with COUNT 100:
//     node read_foxglove.cjs ws://127.0.0.1:8080 100
'use strict';
const { FoxgloveClient } = require('@foxglove/ws-protocol');
const WebSocket = require('ws');

const [url, count] = [process.argv[2], Number(process.argv[3])];
const client = new FoxgloveClient({ ws: new WebSocket(url, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]) });
const channels = new Map();
const topics = new Map();
const messages = {};

function fail(why) {
  console.error(why);
  process.exit(1);
}

client.on('error', fail);
client.on('close', () => fail('the server has closed the connection'));
client.on('status', (status) => fail(status.message));
client.on('advertise', (all) => {
  for (const channel of all) {
    channels.set(channel.id, channel);
    topics.set(client.subscribe(channel.id), channel.topic);
    messages[channel.topic] ??= [];
  }
});
client.on('unadvertise', (ids) => {
  for (const id of ids) channels.delete(id);
});
client.on('message', ({ subscriptionId, timestamp, data }) => {
  if (Object.values(messages).every((each) => each.length === 0)) process.stdout.write('reads\n');
  const topic = topics.get(subscriptionId);
  messages[topic].push([String(timestamp), JSON.parse(new TextDecoder().decode(data))]);
  const records = [...channels.values()].find((channel) => channel.schemaName === 'r4.Record').topic;
  if (topic !== records || messages[records].length !== count) return;
  process.stdout.write(JSON.stringify({ channels: [...channels.values()], messages }), () => process.exit(0));
});
