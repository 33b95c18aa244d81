#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# candied 2.2.0 (npm), decoding by a DBC: a value never leaves the range that the file names, and is a wrong or no
# number where a signal is a float or has its most significant byte first.
#
# The range of a signal, [minimum|maximum], tells what is to be expected. candied takes what is outside for the
# nearest end of it: an axis that overspeeds at 4000 rpm is shown at exactly 3000, for as long as it does, and an
# alarm at "above 3000" never comes. Only [0|0] leaves values alone. SIG_VALTYPE_, which makes an IEEE float of 32
# bits, is parsed and not used. Signals with @0 of more than a byte are NaN, or another number. And of a multiplexed
# message all signals are handed out, whichever the multiplexer names. cantools 45.1.0 decodes all of these. Who
# shows drives by candied gives it Intel's order, no floats, no multiplexers and no ranges.
#
# Output seen:
#   cantools 45.1.0: speed 4000, temperature 25, torque 258, selector 1 pressure 5
#   candied 2.2.0: speed 3000, temperature 1103626240, torque NaN, selector 1 level 5 pressure 5
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
command -v npm > /dev/null && command -v node > /dev/null || exit 77
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet cantools==45.1.0 || exit 77
cd "$folder"
npm install --silent --no-audit --no-fund --ignore-scripts candied@2.2.0 > /dev/null 2>&1 || exit 77
cat >drive.dbc <<'DBC'
VERSION ""

NS_ :

BS_:

BU_: drive

BO_ 389 motion: 8 drive
 SG_ speed : 0|32@1- (1,0) [-3000|3000] "rpm" drive

BO_ 645 heat: 8 drive
 SG_ temperature : 0|32@1- (1,0) [0|0] "degC" drive

BO_ 901 force: 8 drive
 SG_ torque : 7|16@0- (1,0) [0|0] "" drive

BO_ 1157 choice: 8 drive
 SG_ selector M : 0|8@1+ (1,0) [0|0] "" drive
 SG_ level m0 : 8|8@1+ (1,0) [0|0] "" drive
 SG_ pressure m1 : 8|8@1+ (1,0) [0|0] "" drive

SIG_VALTYPE_ 645 temperature : 1;
DBC
cat >cantools_decodes.py <<'PYTHON'
import sys

import cantools

dbc = cantools.database.load_file('drive.dbc')
print(', '.join(' '.join(f'{name} {value:g}' for name, value in dbc.decode_message(
    int(frame[:3], 16), bytes.fromhex(frame[4:])).items()) for frame in sys.argv[1:]))
PYTHON
cat >candied_decodes.js <<'JAVASCRIPT'
const fs = require('fs');
const { Can, Dbc } = require('candied');

const can = new Can();
can.database = new Dbc().load(fs.readFileSync('drive.dbc', 'utf8'));
console.log(process.argv.slice(2).map((text) => {
  const [number, data] = text.split('#');
  const message = can.decode(can.createFrame(parseInt(number, 16), [...Buffer.from(data, 'hex')]));
  return [...message.boundSignals].map(([name, { value }]) => `${name} ${value}`).join(' ');
}).join(', '));
JAVASCRIPT
frames=(185#A00F000000000000 285#0000C84100000000 385#0102000000000000 485#0105000000000000)
seen="cantools 45.1.0: $(venv/bin/python cantools_decodes.py "${frames[@]}")
candied 2.2.0: $(node candied_decodes.js "${frames[@]}")"
echo "$seen"
[ "$seen" = 'cantools 45.1.0: speed 4000, temperature 25, torque 258, selector 1 pressure 5
candied 2.2.0: speed 3000, temperature 1103626240, torque NaN, selector 1 level 5 pressure 5' ]
