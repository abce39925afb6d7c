// SPDX-License-Identifier: GPL-3.0-or-later
// Reads an MCAP file by npm's @mcap/core, from its beginning and by its indexes. Both readings must agree, and every
// checksum, offset and count must be right. Prints a JSON object: the topics, and the messages in the order of the file
// as [topic, microseconds, object].
'use strict';
const assert = require('node:assert/strict');
const fs = require('node:fs');
const { crc32 } = require('@foxglove/crc');
const { McapIndexedReader, McapStreamReader } = require('@mcap/core');
const fzstd = require('fzstd');

const MESSAGE_INDEX = 0x07;
const bytes = fs.readFileSync(process.argv[2]);

function decompress(packed, size) {
  const unpacked = fzstd.decompress(packed);
  assert.equal(BigInt(unpacked.length), size);
  return unpacked;
}

// The reader checks the checksum of each chunk. Each chunk must have the channels of its messages.
function readStream() {
  const reader = new McapStreamReader({ decompressHandlers: { zstd: decompress }, includeChunks: true });
  const records = { Chunk: [], Message: [] };
  const defined = new Set();
  const pieceSize = 65536;
  for (let at = 0; at < bytes.length; at += pieceSize) {
    reader.append(bytes.subarray(at, at + pieceSize));
    for (let record; (record = reader.nextRecord()); ) {
      if (record.type === 'Chunk') defined.clear();
      if (record.type === 'Channel') defined.add(record.id);
      if (record.type === 'Message') assert(defined.has(record.channelId));
      records[record.type]?.push(record);
    }
  }
  assert(reader.done(), 'the file is not whole');
  return records;
}

// The reader checks the checksum of the summary.
function openIndexed() {
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) => {
      assert(offset + size <= bytes.length);
      return bytes.subarray(Number(offset), Number(offset + size));
    },
  };
  return McapIndexedReader.Initialize({ readable, decompressHandlers: { zstd: decompress } });
}

const textOf = (message) => Buffer.from(message.data).toString('utf8');
const wordsOf = ({ channelId, sequence, logTime, publishTime, ...message }) =>
  [channelId, sequence, logTime, publishTime, textOf(message)].join(' ');

async function checkMessages(indexed, stream) {
  const counts = new Map();
  for (const each of stream.Message) {
    assert.equal(each.publishTime, each.logTime);
    assert.equal(each.sequence, counts.get(each.channelId) ?? 0);
    counts.set(each.channelId, each.sequence + 1);
  }
  const found = [];
  for await (const each of indexed.readMessages({ validateCrcs: true })) found.push(wordsOf(each));
  assert.deepEqual(found.sort(), stream.Message.map(wordsOf).sort(), 'the indexes have all messages');
  for (const channel of indexed.channelsById.values()) {
    let count = 0;
    for await (const each of indexed.readMessages({ topics: [channel.topic] })) {
      assert.equal(each.channelId, channel.id);
      ++count;
    }
    assert.equal(count, counts.get(channel.id), channel.topic);
    assert.equal(indexed.statistics.channelMessageCounts.get(channel.id), BigInt(count));
  }
}

function checkStatistics(indexed, stream) {
  const times = stream.Message.map((each) => each.logTime);
  const { type, channelMessageCounts, ...told } = indexed.statistics;
  assert.deepEqual(told, {
    messageCount: BigInt(stream.Message.length),
    schemaCount: indexed.schemasById.size,
    channelCount: indexed.channelsById.size,
    attachmentCount: 0,
    metadataCount: 0,
    chunkCount: stream.Chunk.length,
    messageStartTime: times.reduce((a, b) => (a < b ? a : b)),
    messageEndTime: times.reduce((a, b) => (a > b ? a : b)),
  });
  assert.equal(channelMessageCounts.size, indexed.channelsById.size);
}

function checkChunks(indexed, stream) {
  assert.equal(indexed.chunkIndexes.length, stream.Chunk.length);
  indexed.chunkIndexes.forEach((index, i) => {
    const chunk = stream.Chunk[i];
    for (const key of ['messageStartTime', 'messageEndTime', 'compression', 'uncompressedSize']) {
      assert.equal(index[key], chunk[key], key);
    }
    assert.equal(index.compressedSize, BigInt(chunk.records.byteLength));
    assert.notEqual(chunk.uncompressedCrc, 0);
    const end = index.chunkStartOffset + index.chunkLength + index.messageIndexLength;
    assert.equal(end, indexed.chunkIndexes[i + 1]?.chunkStartOffset ?? indexed.dataEndOffset);
    for (const [channel, offset] of index.messageIndexOffsets) {
      assert.equal(bytes[Number(offset)], MESSAGE_INDEX);
      assert.equal(bytes.readUInt16LE(Number(offset) + 9), channel);
    }
  });
}

function checkSummary(indexed) {
  assert.equal(indexed.dataSectionCrc, crc32(bytes.subarray(0, Number(indexed.dataEndOffset))));
  assert.notEqual(indexed.footer.summaryCrc, 0);
  let at = indexed.footer.summaryStart;
  for (const [opcode, group] of indexed.summaryOffsetsByOpcode) {
    assert.equal(group.groupStart, at);
    assert.equal(bytes[Number(at)], opcode);
    at += group.groupLength;
  }
  assert.equal(at, indexed.footer.summaryOffsetStart);
}

function topicsOf(indexed) {
  const topics = {};
  for (const { topic, schemaId, messageEncoding, metadata } of indexed.channelsById.values()) {
    const schema = indexed.schemasById.get(schemaId);
    assert.equal(messageEncoding, 'json');
    assert.equal(schema.encoding, 'jsonschema');
    assert.equal(JSON.parse(textOf(schema)).type, 'object');
    topics[topic] = [schema.name, Object.fromEntries(metadata)];
  }
  return topics;
}

async function main() {
  const stream = readStream();
  const indexed = await openIndexed();
  assert.equal(indexed.header.profile, 'r4log');
  await checkMessages(indexed, stream);
  checkStatistics(indexed, stream);
  checkChunks(indexed, stream);
  checkSummary(indexed);
  const messages = stream.Message.map((each) => [
    indexed.channelsById.get(each.channelId).topic,
    Number(each.logTime / 1000n),
    JSON.parse(textOf(each)),
  ]);
  process.stdout.write(JSON.stringify({ topics: topicsOf(indexed), messages }));
}

main();
