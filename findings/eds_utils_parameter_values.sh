#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# eds-utils 0.3.1: a DCF that it has read and written again configures nothing, and arrays in short form are empty.
#
# A DCF differs from an EDS by ParameterValue, what an object is to be set to (CiA 306). read_eds() does not know that
# key: it "fixes" the file by leaving it out, as it does with each key that is not on its list, and write_eds() writes
# DefaultValue alone. So a drive that is set up from the new file stays at its defaults. Of CompactSubObj, which stands
# for as many sub-indices as it says, nothing is left but sub-index 0 with the number 0. Both are in the list of errors
# that read_eds() returns; the editor and eds2dcf write the file all the same. Write values of a DCF by other means.
#
# Read by canopen 2.4.1 before and after. Output seen:
#   before: acceleration 2500, third cam True
#   after: acceleration 1000, third cam False
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet canopen==2.4.1 eds-utils==0.3.1 || exit 77
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import canopen
from eds_utils.core.file_io.read_eds import read_eds
from eds_utils.core.file_io.write_eds import write_eds

FILE = """[FileInfo]
FileName=before.dcf
LastEDS=drive.eds
CreationTime=10:00AM
CreationDate=11-30-2026
ModificationTime=10:00AM
ModificationDate=11-30-2026

[DeviceInfo]
VendorName=us
ProductName=drive

[DeviceComissioning]
NodeID=0x5
NodeName=axis
BaudRate=500

[MandatoryObjects]
SupportedObjects=0

[OptionalObjects]
SupportedObjects=1
1=0x6083

[6083]
ParameterName=Profile acceleration
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=1000
ParameterValue=2500
PDOMapping=0

[ManufacturerObjects]
SupportedObjects=1
1=0x2001

[2001]
ParameterName=Cams
ObjectType=0x8
DataType=0x0003
AccessType=rw
DefaultValue=5
CompactSubObj=3
"""


def content(path):
    objects = canopen.import_od(path)
    acceleration = objects[0x6083]
    value = acceleration.default if acceleration.value is None else acceleration.value
    return f'acceleration {value}, third cam {3 in objects[0x2001]}'


with open('before.dcf', 'w') as file:
    file.write(FILE)
write_eds(read_eds('before.dcf')[0], 'after.dcf')
lines = [f'{name}: {content(f"{name}.dcf")}' for name in ('before', 'after')]
print(*lines, sep='\n')
sys.exit(lines != ['before: acceleration 2500, third cam True', 'after: acceleration 1000, third cam False'])
PYTHON
