#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# canopen 2.4.1 (2.3.0 alike), export_dcf: negative and changed values are lost on the way into a DCF.
#
# A value below 0 is written as "0x-3E8", which is no number: the next import_eds drops it without an error or a line
# in the log, as other readers may or may not. An object whose file had a ParameterValue is written with that one
# again, whatever its value is now, because the text that was read goes before the value. And [FileInfo] of the first
# file that a program exports is in all that it exports after it: the dictionary that takes it is a default argument.
# A DCF is what a drive is commissioned with; who writes one so compares it with the drive afterwards.
#
# Output seen, of a home offset (INTEGER32) that was set in the object dictionary, exported and read again:
#   2.3.0: 1000 comes back as 1000, -1000 as None; 200 set over the file's 100 as 100; gripper's file says lift.eds
#   2.4.1: 1000 comes back as 1000, -1000 as None; 200 set over the file's 100 as 100; gripper's file says lift.eds
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
for version in 2.3.0 2.4.1; do
  python3 -m venv "$folder/$version" || exit 77
  "$folder/$version/bin/pip" install --quiet "canopen==$version" || exit 77
  "$folder/$version/bin/python" -W ignore - "$version" <<'PYTHON'
import io
import sys

from canopen.objectdictionary import eds

FILE = ('[FileInfo]\nFileName={0}.eds\n[DeviceInfo]\nProductName={0}\n[Comments]\nLines=0\n'
        '[607C]\nParameterName=Home offset\nObjectType=7\nDataType=4\nAccessType=rw\n{1}')


def read(text):
    return eds.import_eds(io.StringIO(text), node_id=5)


def export(objects):
    file = io.StringIO()
    eds.export_dcf(objects, file)
    return file.getvalue()


def comes_back(value, line=''):
    objects = read(FILE.format('lift', line))
    objects[0x607C].value = value
    return read(export(objects))[0x607C].value


found = [comes_back(1000), comes_back(-1000), comes_back(200, 'ParameterValue=100\n')]
gripper = export(read(FILE.format('gripper', '')))
name, = (line.partition('=')[2] for line in gripper.splitlines() if line.startswith('FileName='))
print(f"{sys.argv[1]}: 1000 comes back as {found[0]}, -1000 as {found[1]}; 200 set over the file's 100 as "
      f"{found[2]}; gripper's file says {name}")
sys.exit((found, name) != ([1000, None, 100], 'lift.eds'))
PYTHON
done
