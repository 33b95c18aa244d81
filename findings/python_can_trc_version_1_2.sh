#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# python-can 4.6.1, TRCReader: a .trc of version 1.2 or 3.0 is read as version 1.0, and fails at its first entry.
#
# PEAK's format is known to the reader in the versions 1.1, 1.3, 2.0 and 2.1; any other is taken for 1.0,
# at the level of logging "info". In 1.2 the third column is the bus and the fourth the direction, which the
# reader takes for identifier and length: ValueError for "Rx". A file of version 3.0 has the columns that its
# own $COLUMNS names, as 2.1 has. Both are read whole if the first line says 1.3 (with a column "-" in front
# of the length) or 2.1.
#
# Output seen:
#   4.6.1: 1.2 ValueError, 1.2 as 1.3 [(3, 1797)], 3.0 ValueError, 3.0 as 2.1 [(3, 1797)]
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet python-can==4.6.1 || exit 77
"$folder/venv/bin/python" - <<'PYTHON'
import io
import sys

import can

HEAD = ';$FILEVERSION={}\n;$STARTTIME=45000.5\n'
COLUMNS = ';$COLUMNS=N,O,T,B,I,d,R,V,S,A,r,s,L,D\n'
ENTRY_3 = '      1       100.000 DT 3       705 Rx - - - - - - 1   05\n'
FILES = {'1.2': HEAD.format('1.2') + '     1)      100.000  3  Rx         0705  1  05\n',
         '1.2 as 1.3': HEAD.format('1.3') + '     1)      100.000  3  Rx         0705 -  1  05\n',
         '3.0': HEAD.format('3.0') + COLUMNS + ENTRY_3,
         '3.0 as 2.1': HEAD.format('2.1') + COLUMNS + ENTRY_3}


def read(text):
    try:
        return str([(each.channel, each.arbitration_id)
                    for each in can.TRCReader(io.StringIO(text))])
    except ValueError:
        return 'ValueError'


found = {name: read(text) for name, text in FILES.items()}
print(f'{can.__version__}: ' + ', '.join(f'{name} {what}' for name, what in found.items()))
sys.exit(found != {'1.2': 'ValueError', '1.2 as 1.3': '[(3, 1797)]', '3.0': 'ValueError',
                   '3.0 as 2.1': '[(3, 1797)]'})
PYTHON
