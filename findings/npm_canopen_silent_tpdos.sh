#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# canopen 6.2.1 (npm, by Daxbot), a device: TPDOs of type 255, and those with a SYNC start value, are never sent.
#
# Of the event-driven types only 254 is looked at, so that a TPDO of type 255 (event-driven as the
# profile has it) is accepted and stays silent whatever its objects, timer and inhibit time are. The SYNC start value is
# compared with the second byte of SYNC, which has one: the comparison is never true, and the TPDO waits for ever.
# And a mapping that is written by SDO to a node in operational is acknowledged and read back, while what is sent
# stays as it was, until the node leaves that state and comes back: a master that trusts 1A00h decodes other objects
# than those in the PDO. Use types 254 and 1, no start value, and write mappings in pre-operational.
#
# Shown with the device alone: its "message" events are what it would send. Output seen:
#   6.2.1: changed once: type 254 sent 1, type 255 sent 0
#   6.2.1: five SYNCs: start value 0 sent 5, start value 2 sent 0
#   6.2.1: mapping written true, read as 20020010, PDO still 1111, 2222 behind pre-operational and start
# Exit code 0: still so; 1: the behaviour has changed; 77: npm, node or the package cannot be had.
set -eu
command -v npm > /dev/null && command -v node > /dev/null || exit 77
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-save --ignore-scripts --prefix "$folder" canopen@6.2.1 > /dev/null 2>&1 || exit 77
cat > shown.js <<'JAVASCRIPT'
// its check sums are a native module, built by an install script; only block transfers use them, none is here
const Module = require('module');
const load = Module._load;
Module._load = (name, ...rest) => name === 'node-crc' ? {} : load(name, ...rest);
const { Device, Eds, DataType } = require('canopen');

function device(parameters) {
    const eds = new Eds();
    const objects = [0x2001, 0x2002].map((index, number) => eds.addEntry(index, {
        parameterName: `value ${number}`, dataType: DataType.UNSIGNED16, defaultValue: 0x1111 * (number + 1) }));
    eds.setSyncCobId(0x80);
    eds.addSdoServerParameter(0, 0x585, 0x605);
    eds.addTransmitPdo({ cobId: 0x185, dataObjects: [objects[0]], ...parameters });
    const made = new Device({ id: 5, eds });
    made.sent = [];
    made.on('message', (message) => made.sent.push(message));
    made.start();
    made.nmt.startNode();
    made.receive({ id: 0, data: Buffer.from([1, 5]) });
    made.pdos = () => made.sent.filter((message) => message.id === 0x185);
    made.ask = (text) => {
        made.receive({ id: 0x605, data: Buffer.from(text, 'hex') });
        return made.sent.at(-1).data;
    };
    made.change = () => { objects[0].value = 0x1112; };
    made.syncs = () => {
        for (let counter = 1; counter <= 5; counter++)
            made.receive({ id: 0x80, data: Buffer.from([counter]) });
        return made.pdos().length;
    };
    return made;
}

async function changed(transmissionType) {
    const made = device({ transmissionType });
    made.change();
    await new Promise((resolve) => setTimeout(resolve, 50));
    return made.pdos().length;
}

(async () => {
    const lines = [
        `changed once: type 254 sent ${await changed(254)}, type 255 sent ${await changed(255)}`,
        `five SYNCs: start value 0 sent ${device({ transmissionType: 1 }).syncs()}, ` +
        `start value 2 sent ${device({ transmissionType: 1, syncStart: 2 }).syncs()}`];
    const made = device({ transmissionType: 1 });
    let written = true;
    // as CiA 301 has it: COB-ID invalid, count 0, entry, count, COB-ID
    for (const text of [
        '2300180185010080', '2f001a0000000000', '23001a0110000220', '2f001a0001000000', '2300180185010000'])
        written &&= made.ask(text)[0] === 0x60;
    const read = made.ask('40001a0100000000').readUInt32LE(4).toString(16);
    const before = made.pdos().length;
    made.syncs();
    const still = made.pdos()[before].data.toString('hex');
    for (const command of [0x80, 1])
        made.receive({ id: 0, data: Buffer.from([command, 5]) });
    made.syncs();
    lines.push(`mapping written ${written}, read as ${read}, PDO still ${still}, ` +
        `${made.pdos().at(-1).data.toString('hex')} behind pre-operational and start`);
    for (const line of lines)
        console.log(`6.2.1: ${line}`);
    process.exit(JSON.stringify(lines) === JSON.stringify([
        'changed once: type 254 sent 1, type 255 sent 0',
        'five SYNCs: start value 0 sent 5, start value 2 sent 0',
        'mapping written true, read as 20020010, PDO still 1111, 2222 behind pre-operational and start']) ? 0 : 1);
})();
JAVASCRIPT
node shown.js
