#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# durand 0.5.0: a TPDO of transmission type n (every nth SYNC) is sent with the nth SYNC, and then with
# every one: SyncHandler counts up to n and never begins again.
#
# CiA 301 has types 2 to 240 send once in n SYNCs, which is how the load of a bus is planned.
#
# Shown with a network of its own that only notes what is sent; SDO and NMT as from a master.
# Output seen:
#   type 3: sent with SYNC 3 4 5 6 7 8 9
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet durand==0.5.0 python-can==4.6.1 || exit 77
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import durand


class Network:
    def __init__(self):
        self.heard, self.sent = {}, []

    def add_subscription(self, cob_id, callback):
        self.heard[cob_id] = callback

    def remove_subscription(self, cob_id):
        self.heard.pop(cob_id)

    def send(self, cob_id, msg):
        self.sent.append(cob_id)

    def receive(self, text):
        cob_id, data = text.split('#')
        self.heard[int(cob_id, 16)](int(cob_id, 16), bytes.fromhex(data))


network = Network()
node = durand.MinimalNode(network, 5)
node.object_dictionary[0x2000] = durand.Variable(durand.DatatypeEnum.UNSIGNED16, 'ro', 0)
for frame in ('605#23001801850100C0',       # TPDO1 not valid
              '605#23001A0110000020',       # 2000h, 16 bits
              '605#2F001A0001000000',       # one entry
              '605#2F00180203000000',       # type 3
              '605#2300180185010040',       # valid
              '000#0105'):                  # NMT start
    network.receive(frame)
came = []
for number in range(1, 10):
    network.sent.clear()
    network.receive('080#')
    came += [number] * network.sent.count(0x185)
print('type 3: sent with SYNC', *came)
sys.exit(came != [3, 4, 5, 6, 7, 8, 9])
PYTHON
