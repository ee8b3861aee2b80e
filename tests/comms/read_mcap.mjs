// Read an MCAP file with @mcap/core by its index; print counts, order, schemas and attachments as JSON.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const require = createRequire(`${process.argv[3]}/`);
const { McapIndexedReader } = require("@mcap/core");
const { decompress } = require("fzstd");

const data = new Uint8Array(readFileSync(process.argv[2]));
const readable = {
  size: async () => BigInt(data.length),
  read: async (offset, size) => data.subarray(Number(offset), Number(offset) + Number(size)),
};
const decompressHandlers = {
  zstd: (buffer, size) => decompress(buffer, new Uint8Array(Number(size))),
};

const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const counts = {};
let ordered = true;
let last = -1n;
for await (const message of reader.readMessages()) {
  const topic = reader.channelsById.get(message.channelId).topic;
  counts[topic] = (counts[topic] ?? 0) + 1;
  ordered &&= message.logTime >= last;
  last = message.logTime;
}
const schemas = [...reader.schemasById.values()].map((schema) => schema.name).sort();
const attachments = [];
for await (const attachment of reader.readAttachments()) {
  attachments.push(attachment.name);
}
console.log(JSON.stringify({ counts, ordered, schemas, attachments }));
