#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# canopen 2.4.1 (2.3.0 alike), BaseNode402: a drive that is enabled is switched off by asking for "operation enabled".
#
# Until the first TPDO with the status word has come, BaseNode402 takes 0 for it, which it reads as "not ready to
# switch on". Where that TPDO is sent on change only (types 254 and 255), an enabled drive that nothing happens to
# sends none: state is wrong, and setting it to 'OPERATION ENABLED' begins with control word 0, disable voltage. The
# motor coasts, or a brake falls in, and is enabled again by what follows. check_statusword() reads the right value
# by SDO meanwhile, but does not keep it. Who takes over a running drive reads sdo[0x6041] first and puts it into
# tpdo_values[0x6041], or has the drive send a TPDO.
#
# Shown with a LocalNode that answers each control word, on python-can's virtual bus. Output seen:
#   2.3.0: status word 0627h, state NOT READY TO SWITCH ON, control words 0000h 0006h 0007h 000Fh
#   2.4.1: status word 0627h, state NOT READY TO SWITCH ON, control words 0000h 0006h 0007h 000Fh
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
for version in 2.3.0 2.4.1; do
  python3 -m venv "$folder/$version" || exit 77
  "$folder/$version/bin/pip" install --quiet "canopen==$version" python-can==4.6.1 || exit 77
  "$folder/$version/bin/python" - "$version" <<'PYTHON'
import io
import logging
import sys

import canopen
from canopen.objectdictionary import eds
from canopen.profiles.p402 import BaseNode402

RECORDS = {0x1400: ((5, 2), (7, '$NODEID+0x200'), (5, 255)), 0x1600: ((5, 1), (7, '0x60400010')),
           0x1800: ((5, 2), (7, '$NODEID+0x180'), (5, 255)), 0x1A00: ((5, 1), (7, '0x60410010'))}
#: status words by control words
ANSWERS = {0x00: 0x0640, 0x06: 0x0621, 0x07: 0x0623, 0x0F: 0x0627}


def dictionary():
    text = '[DeviceInfo]\n'
    variables = [('6040', 6, 15), ('6041', 6, ANSWERS[15])]
    for index, entries in RECORDS.items():
        text += f'[{index:X}]\nParameterName={index:X}\nObjectType=9\n'
        variables += [(f'{index:X}sub{number}', *entry) for number, entry in enumerate(entries)]
    for name, kind, value in variables:
        text += f'[{name}]\nParameterName={name}\nObjectType=7\nDataType={kind}\nAccessType=rw\nDefaultValue={value}\n'
    return eds.import_eds(io.StringIO(text), 5)


def answer(_, data, __):
    written.append(int.from_bytes(data, 'little'))
    drive.sdo[0x6041].raw = status = ANSWERS[written[-1]]
    bench.send_message(0x185, status.to_bytes(2, 'little'))


logging.disable()
written = []
bench, network = canopen.Network(), canopen.Network()
for each in (bench, network):
    each.connect(interface='virtual', channel='bench')
drive = bench.create_node(5, dictionary())
bench.subscribe(0x205, answer)
node = BaseNode402(5, dictionary())
network.add_node(node)
for pdos in (node.tpdo, node.rpdo):
    pdos.read(from_od=True)
node.setup_402_state_machine(read_pdos=False)
status, state = node.sdo[0x6041].raw, node.state
node.state = 'OPERATION ENABLED'
for each in (network, bench):
    each.disconnect()
print(f'{sys.argv[1]}: status word {status:04X}h, state {state}, control words',
      *(f'{word:04X}h' for word in written))
sys.exit((status, state, written) != (0x0627, 'NOT READY TO SWITCH ON', [0x00, 0x06, 0x07, 0x0F]))
PYTHON
done
