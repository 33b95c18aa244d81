#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# canopen 2.4.1 (2.3.0 alike), import_eds: sub-indices disappear where the head says that it is a variable.
#
# A section [2000] with ObjectType=7 (or without that key, which CiA 306 reads as 7) in front of
# sections [2000sub0] and [2000sub1]: the object becomes a variable, and the sub-indices are dropped
# without an error or a line in the log. Where the head has no DataType, as heads of records have none,
# the import of the whole file ends with NoOptionError instead. Files of makers have both kinds.
#
# Output seen:
#   2.3.0: with DataType: ODVariable, logged: []; without: NoOptionError
#   2.4.1: with DataType: ODVariable, logged: []; without: NoOptionError
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
for version in 2.3.0 2.4.1; do
  python3 -m venv "$folder/$version" || exit 77
  "$folder/$version/bin/pip" install --quiet "canopen==$version" || exit 77
  "$folder/$version/bin/python" - "$version" <<'PYTHON'
import io
import logging
import sys

from canopen.objectdictionary import eds

HEAD = '[DeviceInfo]\n[2000]\nParameterName=Hoist\nObjectType=7\nAccessType=rw\n'
SUBS = ('[2000sub0]\nParameterName=Highest\nObjectType=7\nDataType=5\nAccessType=ro\n'
        '[2000sub1]\nParameterName=Lift\nObjectType=7\nDataType=6\nAccessType=rw\n')
logged = []
handler = logging.Handler()
handler.emit = lambda record: logged.append(record.getMessage())
logging.getLogger().addHandler(handler)
kind = type(eds.import_eds(io.StringIO(f'{HEAD}DataType=6\n{SUBS}'), node_id=1)[0x2000]).__name__
error = ''
try:
    eds.import_eds(io.StringIO(HEAD + SUBS), node_id=1)
except Exception as caught:     # whatever it is: its name is what is shown
    error = type(caught).__name__
print(f'{sys.argv[1]}: with DataType: {kind}, logged: {logged}; without: {error}')
sys.exit((kind, logged, error) != ('ODVariable', [], 'NoOptionError'))
PYTHON
done
