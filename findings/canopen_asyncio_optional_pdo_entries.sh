#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# canopen-asyncio 2.4.1: PDOs of a node without inhibit time, event timer or SYNC start value cannot be
# read, though these sub-indices (3, 5, 6 of 1400h and 1800h) are optional, and canopen 2.4.1, of which
# it is a port, takes their refusal (06090011h) as "not there" and goes on.
#
# PdoMap.read_generator() catches SdoAbortedError around "yield self.com_record[3]". But read() and
# aread() do the SDO transfer outside the generator and never throw into it: no handler there can see
# the refusal, which ends read(). So with save(), where a count of mapped objects that cannot be
# written (06010002h) is meant to be tolerated.
#
# Shown with a LocalNode of canopen as device, on python-can's virtual bus. Output seen:
#   canopen 2.4.1: PDO read, 1 entry
#   canopen_asyncio 2.4.1: SdoAbortedError 06090011h
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet canopen==2.4.1 canopen-asyncio==2.4.1 python-can==4.6.1 || exit 77
"$folder/venv/bin/python" - <<'PYTHON'
import importlib
import logging
import sys

import canopen


def dictionary(package, optional):
    """Of a device with one TPDO; optional: sub-index 3 is there."""
    made = importlib.import_module(f'{package}.objectdictionary')

    def record(index, entries):
        record = made.ODRecord(f'{index:X}', index)
        for subindex, (kind, value) in entries.items():
            entry = made.ODVariable(f'{index:X}.{subindex}', index, subindex)
            entry.data_type, entry.default = kind, value
            record.add_member(entry)
        return record
    od = made.ObjectDictionary()
    communication = {0: (made.UNSIGNED8, 2), 1: (made.UNSIGNED32, 0x185),
                     2: (made.UNSIGNED8, 255)}
    if optional:
        communication[3] = made.UNSIGNED16, 0
    od.add_object(record(0x1800, communication))
    od.add_object(record(0x1A00, {
        0: (made.UNSIGNED8, 1), 1: (made.UNSIGNED32, 0x20000110)}))
    od.add_object(record(0x2000, {1: (made.UNSIGNED16, 0)}))
    return od


logging.disable()
device = canopen.Network()
device.connect(interface='virtual', channel='bench')
device.create_node(5, dictionary('canopen', False))
seen = []
for name in ('canopen', 'canopen_asyncio'):
    package = importlib.import_module(name)
    network = package.Network()
    network.connect(interface='virtual', channel='bench')
    node = package.RemoteNode(5, dictionary(name, True))
    network.add_node(node)
    try:
        node.tpdo[1].read()
        seen.append(f'PDO read, {len(node.tpdo[1])} entry')
    except package.SdoAbortedError as error:
        seen.append(f'SdoAbortedError {error.code:08X}h')
    print(f'{name} {package.__version__}: {seen[-1]}')
    network.disconnect()
device.disconnect()
sys.exit(seen != ['PDO read, 1 entry', 'SdoAbortedError 06090011h'])
PYTHON
