# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What can be wrong with a configuration or a profile, each with its code.

Rows as in :mod:`.sentences`; what to do is part of the text, which says what is allowed. The
place of the problem is not part of it.
"""

from collections.abc import Iterable
import difflib
import shlex

from drive_can_bridge.core.messages import catalogue, NOTHING, Sentence, Text
from drive_can_bridge.core.text import nearest

_WORDS_MAX = 30
#: names of a profile that are all shown, and how many of more
_NAMES_MAX, _NAMES_NEAREST = 8, 4

#: what a name is that means the control word
THE_CONTROL_WORD = 'the control word, which the bridge sends by itself'

_NEUTRAL_FROM = ('write both below the parameter in the profile, for example neutral_from: '
                 'actual_position and arming_tolerance: 0.01 (in its unit)')

# -- what may be meant instead
did_you_mean = Text("did you mean '{word}'?", do='write that word')
near = Text(" (did you mean '{word}'?)",
            do='write that word (stands behind a text that says what is wrong)')
allowed = Text('allowed: {words}', do='write one of these')
some_allowed = Text(
    'allowed are for example {words}; all: drive_can profile show {profile}',
    do='write a name that the profile has')
some_allowed_here = Text(
    'allowed are for example {words}; all stand below parameters in this file',
    do='write a name that stands below parameters')
nothing_allowed = Text('nothing is allowed here', do='leave it out')
allowed_below = Text(
    'allowed is {entry} below it',
    do='put it below that key, indented by two more spaces')
list_empty = Text('{listed} is empty', do='name at least one parameter in that list')
no_profile_at_all = Text(
    'there is no profile at all',
    do='make one: drive_can profile import FILE -o FILE, and see drive_can profile list')
two_protocols = Text(
    ' (a drive of CiA 402 is cia402, a Schneider TeSys T is canopen_pkw)',
    do='write protocol: cia402 for a servo drive, protocol: canopen_pkw for a TeSys T')
to_be_imported = Text(
    'a profile is made of it by: drive_can profile import {name} -o drive.yaml',
    do='run that command, and name the file that it writes as profile')

# -- values and keys
missing = Text('missing, allowed is {allowed}', do='add the key, with a value that is allowed')
missing_called = Text(
    'missing, allowed is {allowed}: {theirs} is called {ours} here',
    do='call it as it is called here')
other_entry_meant = Text(
    "no {lacking}, did you mean '{near}'?",
    do='write that name, or complete the entry where it is another one')
unknown_key = Text(
    'unknown key, {hint}',
    do='write the key that is named, or leave yours out; docs/profiles.md and '
       'docs/ros_interface.md list them')
unknown_key_of_bridge = Text(
    "unknown key, did you mean '{word}'? It is set by the bridge itself",
    do='leave it out: the bridge says it, a file cannot set it')
wrong_type = Text(
    '{value!r} is {kind}, allowed is {allowed}',
    do='write a value of that type, without quotes unless it is text')
wrong_kind = Text('{kind}, allowed is {allowed}')
number_in_words = Text(
    '{value!r} is {kind}, allowed is {allowed}: write {number}',
    do='write the number as it stands there, without quotes and unit')
word_as_bool = Text(
    '{value!r} is {kind} (so are on, off, yes and no without quotes), allowed is {allowed}: write '
    'it in quotes',
    do="put the word in quotes: 'on'")
one_entry = Text(
    '{value!r} is {kind}, allowed is {allowed}: write [{value}]',
    do='put the value in brackets: [value]')
not_finite = Text(
    '{value!r} is not a finite number, allowed is {allowed}',
    do='write a number: no .inf, no .nan')
unknown_word = Text(
    '{value!r} is unknown{near}, allowed is {allowed}',
    do='write one of the words that are allowed')
out_of_range = Text(
    '{value!r} is out of range, allowed is {allowed}',
    do='write a value within the range')
out_of_range_in_kilo = Text(
    '{value!r} is out of range, allowed is {allowed}: it is in bit/s, {value} kbit/s are {number}',
    do='write the bit rate in bit/s')
comment_without_space = Text(
    '{value!r} is {kind}, allowed is {allowed}: a comment needs a space before its #',
    do='put a space before the #')
wrong_name = Text(
    '{value!r} is wrong, allowed is {allowed}: write {name}',
    do='write a name like that')
value_out_of_range = Text(
    '{value} is out of range, allowed is {least} to {most}{remark}',
    do='write a value within the range, or correct minimum and maximum in the profile')
wrong = Text('{value!r} is wrong, allowed is {allowed}')
useless = Text('{value!r} is useless, allowed is any other number')
empty_string = Text('an empty string, allowed is text', do='write a text, or leave the key out')
number_of_values = Text(
    'a list of {count} values, allowed are {allowed}',
    do='write as many values as are allowed: [1, 2]')
empty_mapping = Text(
    'an empty mapping, allowed is at least one entry',
    do='write an entry below it, indented by two more spaces, or leave the key out')
too_many_entries = Text(
    'a mapping of {count} entries, allowed are at most {allowed}',
    do='leave some out, or use several bridges')
key_of_others = Text(
    'a key of {owners}, allowed with {family} is to leave it out',
    do='leave the key out, or choose the protocol that has it')
not_while_running = Text(
    '{name} cannot change while the node runs; change the parameter file and restart',
    do='change the file, and start the bridge again')
unknown = Text('{name!r} is unknown, {hint}')
no_directory = Text('{name!r} is no directory', do='make the directory, or write the path of one')
no_home = Text(
    '{value!r} begins with an unknown home directory, allowed is a path without ~',
    do='write the whole path: /home/NAME/…')

# -- the file itself
not_yaml = Text(
    'not valid YAML: {what}',
    do='look at the line before, too: a colon, a quote, a bracket or the indentation is wrong')
indented_like_no_key = Text(
    'not valid YAML: {what} (no key above it is indented like it: is one missing?)',
    do='indent the line like the other keys of its mapping, with spaces')
two_keys_in_line = Text(
    'two keys in one line need braces, or a line each',
    do='write main: {interface: slcan, channel: /dev/ttyACM0}, or each key in a line of its own, '
       'indented alike')
tab = Text(
    'a tab in the indentation, allowed are spaces',
    do='replace each tab by spaces (two for each level)')
too_deep = Text(
    'nested too deep, allowed are {levels} levels',
    do='look at the indentation; no key is nested so deep')
no_section = Text(
    'no section of the file holds it, allowed is one /**/drive_can_bridge: {{ros__parameters: '
    '{{buses: …}}}}',
    do='let the file begin with: /**/drive_can_bridge:, below it ros__parameters:, below that '
       'buses: and drives:')
no_section_of = Text(
    'no section of the file holds it, allowed is one /**/drive_can_bridge: {{ros__parameters: '
    '{{buses: …}}}}; the file has: {names}',
    do='name the section /**/drive_can_bridge, or start the bridge with that name (-r '
       '__node:=NAME)')
second_section = Text(
    'in a second section, {section}; allowed is one section that holds it (the first is {first})',
    do='move its keys into the first section, and delete it')
is_profile = Text(
    'a profile, allowed is NODE_NAME: {{{entry}: …}}; drive_can profile check looks at profiles',
    do='run: drive_can profile check FILE; as parameter file give the one that names this '
       'profile')
nothing_configured = Text(
    'node {node} got neither buses nor drives: give a parameter file with --ros-args '
    '--params-file FILE',
    do='run: ros2 run drive_can_bridge drive_can_bridge --ros-args --params-file FILE')
file_is_for = Text(
    '{file} is for {nodes}',
    do='give the file of this bridge, or name its section /**/drive_can_bridge')
no_mapping = Text('no mapping, allowed is NODE_NAME: {{{entry}: …}}')
no_mapping_refused = Text('no mapping (rcl refuses the file), {hint}')
parameters_missing = Text(
    'is missing below {section}, allowed is a line of its own with the rest indented below it',
    do='write ros__parameters: there, and indent what follows by two more spaces')
without_head = Text(
    'stands at the beginning of the file, allowed is below /**/drive_can_bridge: and {entry}:, '
    'each indented by two more spaces',
    do='write /**/drive_can_bridge: and ros__parameters: above it, and indent it by four more '
       'spaces')
no_parameters = Text('no mapping, allowed are parameters')
no_node_name_above = Text(
    'no node name above it, allowed is NODE_NAME: {{{entry}: …}}',
    do='write /**/drive_can_bridge: above ros__parameters:, and indent that by two spaces')
no_node_name = Text(
    '{name!r} is no node name (rcl refuses the file), allowed is for example '
    '/**/drive_can_bridge',
    do='write /**/drive_can_bridge as the name of the section')
key_no_node_name = Text('a key that is no name, allowed are node names')
beside_parameters = Text(
    'stands beside {entry} (rcl refuses or garbles the file), allowed is a section of its own',
    do='move it below ros__parameters:, or into a section of its own')
misspelt = Text('misspelt, allowed is {allowed}', do='write ros__parameters, with two underscores')
other_node_name = Text(
    'only a bridge that is started with this name reads this section, allowed for any other is '
    '/**/{usual}',
    do='name the section /**/drive_can_bridge, or start the bridge with that name (-r '
       '__node:=NAME)')
other_namespace = Text(
    'counts for the bridge in another namespace, and is not checked: checked is {node}',
    do='nothing, where another bridge has that namespace; else write /**/ before the name')
value_and_keys = Text(
    'has a value in one section, and keys below it in another; allowed is one of them',
    do='leave one of the two out')
value_and_below = Text(
    "has a value, and '{below}' below it; allowed is one of them",
    do='leave one of the two out')
duplicate_key = Text(
    'duplicate key, allowed is one (the first is in line {first})',
    do='delete one of the two lines, or give one another name')
no_key = Text('{kind} as a key, allowed is a name')
empty_key = Text('an empty key, allowed is a name')
key_with_nul = Text('a key with a NUL character, allowed is a name')
dots = Text(
    'a key with dots, allowed are nested keys',
    do="write the parts below each other: 'a.b: 1' is a:, and below it b: 1")
alias = Text(
    'an alias{why}, allowed is the value itself',
    do='write the value where the alias (*NAME) stands')
no_value = Text(
    'no value{why}, allowed is a value, or [] for an empty list',
    do='write a value behind the colon')
no_space = Text(
    'no value{why}: a space is missing behind the colon, write {key}: {value}',
    do='write a space behind the colon')
no_colon = Text(
    'no value{why}: a colon is missing, write {key}: {value}',
    do='write a colon and a space between key and value')
not_below = Text(
    'no value{why}: the lines {first} to {last} stand beside it, not below it, indent them by two '
    'more spaces',
    do='indent these lines by two more spaces')
nul = Text('a NUL character, allowed is text without')
garbling_mapping = Text(
    'an empty mapping (rcl garbles what follows), allowed is to leave the key out',
    do='delete the line')
nested_list = Text(
    'a list or mapping in a list, allowed are plain values',
    do='write plain values in the list: [a, b]')
mixed_list = Text(
    '{value!r} is {kind} in a list that began with {first} (rcl refuses the file), allowed are '
    'values of one type',
    do='write all values of the list in one type: [1.0, 2.5], not [1, 2.5]')
more = Text('and {count} more', do='correct the others, and run drive_can validate again')

# -- buses
no_interface = Text(
    '{name!r} is no interface of python-can, {hint}',
    do='see drive_can adapters for the lines of the adapters of this machine')
channel_of_kernel = Text(
    '{name!r} is a SocketCAN device, allowed is interface: socketcan with channel: {name}',
    do='write interface: socketcan, and channel: the name of the device')
channel_of_serial = Text(
    '{name!r} is a serial port, allowed is interface: slcan with channel: {name}',
    do='write interface: slcan, and channel: the name of the port')
driver_missing = Text(
    "the driver of interface '{interface}' is missing ({why}), allowed is one that is installed: "
    '{helps}',
    "the driver of interface '{interface}' is missing ({why}), allowed is one that is installed",
    fields='interface why helps',
    do="do what the text names, or install the driver that python-can's page on that interface "
       'names')
no_serial_port = Text(
    '{channel!r} is no serial port, allowed are a device such as /dev/ttyACM0, '
    'socket://HOST:PORT and rfc2217://HOST:PORT',
    do='see drive_can adapters, and ls /dev/serial/by-id')
bitrate_assumed = Text(
    'bitrate is not given: {bitrate} is assumed',
    do='write the bit rate of the drives: an adapter at another one disturbs the bus')
no_bitrate = Text(
    '{bitrate} is impossible with {interface}, allowed is one of {allowed}',
    do='write one of the bit rates that are allowed, and set the drives to the same')
rate_of_two = Text(
    'one command, S7, sets 800000 bit/s in adapters that keep to LAWICEL, and 750000 bit/s in '
    'CANable 1 and 2',
    do='see which bit rate S7 is in your adapter: one at another rate disturbs the bus')
adapter_does_not_name = Text(
    'the adapter for {interface} does not name this key{near}; it is handed over all the same',
    do="compare the key with python-can's page on that interface")
adapter_needs = Text(
    'the adapter for {interface} needs {keys:, }',
    do='write these keys below the bus')
unknown_adapter = Text(
    '{name!r} is unknown, {hint}; docs/adapters.md has them all',
    do='write a name of docs/adapters.md, or leave adapter out')
adapter_of_other_interface = Text(
    '{name!r} is an adapter for {other}, allowed is interface: {other}, or to leave this key out',
    do='write that interface, or leave adapter out')
adapter_drops = Text(
    '{adapter} never sends {what:, }, which drive {drive} needs ({protocol}); allowed is another '
    'adapter, or another firmware',
    do='use another adapter for that drive (docs/adapters.md)')
no_listen_only = Text(
    '{adapter} has no listen-only mode by this key; it has: {instead}',
    '{adapter} has no listen-only mode',
    fields='adapter instead',
    do='leave the key out, or write what the text names')
only_listens = Text(
    'the adapter only listens then: no drive is sent anything',
    do='leave the key out where drives are to be commanded')
adapter_late = Text(
    '{period:g} s is too short for {adapter}, which keeps what it has received for up to '
    '{latency} ms: answers will be late; recommended is at least {least:g} s, or: {remedy}',
    '{period:g} s is too short for {adapter}, which keeps what it has received for up to '
    '{latency} ms: answers will be late; recommended is at least {least:g} s',
    fields='period adapter latency least remedy',
    do='raise period, or do what the text names')
line_too_slow = Text(
    'the serial line to {adapter} has {rate} bit/s, of which these drives need up to '
    '{share:.0f} %, recommended is at most {most:.0f} %: longer periods, or a faster line',
    do='raise period of the drives, or the rate of the serial line where the adapter can do it')
channel_of_other_bus = Text(
    '{channel!r} is also the channel of bus {bus}; the load is checked for each bus alone',
    do='write both under one bus, unless a multiplexer keeps them apart')
port_of_other_bus = Text(
    '{channel!r} is the serial port of bus {bus}, too, allowed is a port of its own',
    do='write the port of the other adapter (ls /dev/serial/by-id), or use one bus for both')
name_of_other_channel = Text(
    "bus {bus} has a channel of this name: decode takes what other programs' traces have of it "
    'for this bus',
    do='give the bus another name, or name it like its channel')
overload = Text(
    'worst-case load {load:.1f} % at {bitrate} bit/s ({parts}), allowed is {most:.0f} %: use '
    'longer periods, fewer drives or a higher bit rate',
    do='raise period of the drives that need it least; the text says what each of them takes')
high_load = Text(
    'worst-case load {load:.1f} % at {bitrate} bit/s ({parts}), recommended is at most '
    '{most:.0f} %',
    do='raise period of the drives that need it least, or bitrate of bus and drives')

# -- drives
no_drive = Text(
    'no drive is configured',
    do='write a drive below drives: bus, station, protocol, profile')
nobody_knows = Text('cannot be used, nobody knows why')
name_of_bridge = Text(
    '{name!r} is the name of the bridge itself, allowed is any other',
    do='give the drive another name')
topic_too_long = Text(
    '{topic} would have a name of {length} characters in ROS, with drive and namespace, '
    'allowed are {most}',
    do='shorten the name of the drive, of the parameter, or the namespace')
unknown_protocol = Text(
    '{value!r} is unknown{near}; available: {allowed}',
    do='write one of the protocols that are available; drive_can scan shows which one answers')
no_protocol = Text(
    '{value!r} is no protocol; available: {allowed}',
    do='write one of the protocols that are available, as a word')
collides = Text(
    '{station} collides with drive {other} (station {other_station}) on bus {bus}: both use '
    '{purpose}; allowed is a station of its own',
    do='set the station of one of the drives to another number, in the drive and in the file')
told_by_two_buses = Text(
    '{bus!r} is the same as bus {other_bus}: drive {other} there and this one would hear the '
    '{what} of both; allowed is the bus of that drive',
    do='put both drives on one bus of the file')
period_too_short = Text(
    '{period:.9g} s is too short for a round of polling at {bitrate} bit/s, allowed is at '
    'least {least:.9g} s',
    do='raise period, or shorten cyclic_response')
period_in_seconds = Text(
    '{period:g} s from one exchange to the next: it is in seconds, {period:g} ms are {shorter:g}',
    do='write the period in seconds: 20 ms are 0.02')
not_in_profile = Text(
    '{name!r} is not in the profile, {hint}',
    do='write a name of the profile (drive_can profile show NAME), or add the parameter there')
twice = Text('{name!r} stands twice, allowed is once', do='delete one of the two')
read_only = Text(
    '{name!r} is read-only, allowed are parameters with access rw or wo',
    do='take it out of that list, or correct access in the profile')
write_only = Text(
    '{name!r} is write-only, allowed are parameters with access ro or rw',
    do='take it out of that list, or correct access in the profile')
kept_in_eeprom = Text(
    '{name!r} is kept in EEPROM, which cyclic writing would wear out; allowed are parameters '
    'with storage ram',
    do='write it with drive_can write, or set storage: ram in the profile if that is what the '
       'manual says')
empty_list = Text('empty, allowed in {family} is at least one parameter')
control_built_in = Text(
    'control is built in for {family}, allowed is to leave it out',
    do='delete the section control')
control_word_limit = Text(
    '{name!r} is the control word, which is no limit; allowed in what bounds the drive')
no_neutral = Text(
    '{name!r} has no neutral value and raw 0 is out of its range, allowed is a neutral of '
    '{allowed}',
    do='give the parameter a neutral in the profile: the value at which nothing moves')
looks_like_limit = Text(
    '{name!r} looks like a limit, and is sent as {rest}{unit} until it is armed: if it bounds '
    'the drive and moves nothing, give it limit: true and a neutral in the profile',
    do='write limit: true and a neutral below the parameter in the profile, if it bounds the '
       'drive')
control_word_held = Text(
    '{name!r} is the control word, which has no neutral_from; allowed in setpoints')
measured_not_listed = Text(
    '{name!r} is neutral at {measured!r}, which is not in cyclic_response, allowed is to add '
    'it there',
    do='add that parameter to cyclic_response')
immediate_jumps = Text(
    "'immediate' would let {name!r} jump from {measured!r}, allowed with neutral_from is "
    "'neutral'",
    do='write rearm: neutral, or leave rearm out')
broadcast_held = Text(
    '{broadcast!r} sends the same {name!r} to several axes, allowed with neutral_from is none',
    do='write broadcast: none')
status_missing = Text(
    '{name!r} is missing: without the status word the bridge cannot tell whether the drive is '
    'enabled',
    do='add the status word to cyclic_response')

# -- joints
no_quantity = Text(
    'names no quantity, allowed is at least one of {allowed}',
    do='write one of the keys below joint: position_command, velocity_state, …')
not_in_list = Text('{name!r} is not in {listed}, {hint}')
control_word = Text('{name!r} is the control word, allowed is a setpoint')
joint_bounds = Text(
    '{name!r} is a limit: the zero that controllers end with would be a limit of zero, with '
    'which a drive cannot brake',
    do='leave it out of joint, and publish the limit as ~/command/NAME')
joint_commands_limit = Text(
    '{name!r} is a limit, which moves nothing, allowed is a setpoint; a limit has its own '
    'topic, ~/command/{name}',
    do='leave it out of joint, and publish the limit as ~/command/NAME')
is_bool = Text('{name!r} is a bool, allowed is a number')
does_not_convert = Text(
    '{name!r} has {unit}, which does not convert; allowed is one of {allowed}',
    do='correct unit of the parameter in the profile to one that is allowed')
quantity_already = Text('{name!r} is the {quantity} already, allowed is another parameter')
no_neutral_from = Text(
    '{name!r} has no neutral_from: without a command the axis goes to {neutral!r} {unit}, '
    'wherever it stands',
    do=_NEUTRAL_FROM)
no_effect = Text('has no effect: no parameter of the joint has the unit {unit}')
continuous_without_position = Text('goes on with a position, allowed with position only')
continuous_commanded = Text(
    'is for axes that turn on and on, and {name!r} is a position that is commanded, allowed is '
    'false with position_command')
continuous_too_wide = Text(
    '{steps} steps are more than the {bits} bits of {name!r} have, allowed is 2 to {most}')
continuous_too_fast = Text(
    'at {speed:g} {unit} half of the {steps} steps of {name!r} passes in {passed}, samples may '
    'be {gap} apart (missed_limit + 1 periods): which way it turned is not known; allowed is a '
    'shorter period, a smaller missed_limit, a lower maximum or a wider counter')
position_wraps = Text(
    'at {speed:g} {unit} the counter of {name!r} wraps after {after}, the joint jumps; an axis '
    'that turns on and on has continuous: true')
joint_of_other = Text(
    '{name!r} is the joint of drives.{owner} already, allowed is a name of its own',
    do='give one of the joints another name')

# -- profiles
no_file = Text(
    'no file {name}, allowed is an existing one',
    do='correct the path, or make the file: drive_can profile import')
cannot_be_read = Text(
    '{path} cannot be read ({why}), allowed is a readable file',
    do='see the rights of the file: chmod a+r FILE')
no_absolute_path = Text(
    '{name!r} is relative, and no parameter file sets it: write an absolute path ({meant})',
    do='write the whole path')
open_directory = Text(
    '{name!r} is beside a parameter file in a directory that everybody may write to: write an '
    'absolute path ({meant})',
    do='write the whole path, or take the right to write from others: chmod o-w DIRECTORY')
name_with_suffix = Text(
    '{name!r} is unknown, allowed is a name without {suffix}',
    do='write the name without the suffix, or a path with a slash: ./NAME.yaml')
unknown_profile = Text(
    '{name!r} is unknown, {hint} (searched: {places})',
    do='see drive_can profile list for the names')
profile_for_others = Text(
    '{name!r} is for {protocols}, allowed is a profile for {family}',
    do='name a profile for this protocol, or correct protocol')
no_profile = Text('no mapping, allowed are protocols, parameters, control, description')
is_parameter_file = Text(
    'parameters of nodes, allowed is a profile; drive_can validate looks at the file of a bridge',
    do='run: drive_can validate FILE; as profile give the file with the parameters')
second_document = Text(
    'a second document, allowed is one',
    do='delete the line --- and what belongs to the other document')
write_only_one = Text(
    '{name!r} is write-only, allowed is one with access ro or rw',
    do='name a parameter that can be read, or correct access')
no_value_names = Text('{name!r} is {kind}, allowed in integers without scale, offset and unit')
write_only_bits = Text('{name!r} is write-only: its other bits cannot be kept, allowed is a value')
one_word = Text(
    '{type} has one word, allowed in int32 and uint32',
    do='correct type, or the entry')
beside_neutral_from = Text(
    'stands beside neutral_from, allowed is one of them',
    do='delete one of the two')
no_arming_tolerance = Text(
    'needs arming_tolerance: how far a command may be from where the axis is and still arm, '
    'allowed is to give it too',
    do='write arming_tolerance: in the unit of the parameter, as far as the axis may jump '
       'without harm')
read_only_in = Text('{name!r} is read-only, allowed in parameters with access rw or wo')
above_maximum = Text(
    '{minimum!r} is above the maximum, allowed is at most {maximum!r}',
    do='exchange minimum and maximum, or correct one of them')
narrowed = Text(
    '{limit!r} is not representable in {type}, narrowed to {end}',
    do='nothing; write a limit that the type can hold to be rid of the warning')
read_only_one = Text('{name!r} is read-only, allowed is one with access rw or wo')
word_twice = Text(
    '{word!r} is the word for {entry} too, allowed is another one',
    do='give one of the values another word')
mask_too_large = Text(
    'mask {mask} does not fit {name}, allowed is 1 to {largest} ({type})',
    do='write a mask within the bits of that type')
mask_of_nothing = Text('mask 0 looks at no bit, allowed is a mask with at least one')
does_not_fit = Text('{entry} does not fit, allowed is {low} to {high}')
word_is_bool = Text(
    '{word} without quotes is a bool, allowed is text: write it in quotes',
    do="put the word in quotes: 'on'")
no_bit = Text('{bit!r} is no bit of {name}, {hint}')
name_taken = Text(
    '{name!r} is taken by the node of the drive, allowed is any other name',
    do='give the parameter another name')
no_bool = Text('{value!r} is no bool, allowed is true or false')
no_such_bit = Text(
    'bit {position} does not exist in {type}, allowed is 0 to {highest}',
    do='write the number of a bit that the type has; bits count from 0')
no_neutral_of_limit = Text(
    'needs neutral: what is sent until the first command, allowed is to give it too',
    do='write neutral: a limit that is safe until somebody sends another one')
no_actual_value = Text('{name!r} is no actual value, allowed is one that can be read')
no_value_between = Text(
    '{type}{scale} has no value in {limits}, allowed are limits around one (the nearest is '
    '{nearest})',
    do='widen minimum and maximum, or correct scale')
word_too_large = Text('{word} does not fit {name}, allowed is 0 to {largest} ({type})')
outside_mask = Text(
    'value {value} has bits outside of mask {mask} and never matches, allowed are bits of the '
    'mask',
    do='write a value that has no bits but those of the mask')
number_twice = Text(
    '{entry} stands twice (as {other}), allowed is once',
    do='correct number or index of one of the two')
is_number = Text('{name!r} is a number, allowed is text')
fault_without_bit = Text(
    'bit is missing: without a control section nothing says when there is a fault, allowed is '
    'bit: PARAMETER.BIT',
    do='write bit: STATUS.BIT below fault')
raw_name = Text(
    '{name!r} reads as a raw parameter, allowed are names other than p<digits> and '
    'x<hexadecimal digits>',
    do='give the parameter a name that does not look like a number')
bool_has_no = Text('a bool has no {entry}, allowed is to leave it out', do='delete the key')
no_integer = Text(
    '{limit!r} is no integer, allowed without scale, offset and unit are integers',
    do='write a whole number, or give the parameter a scale')
no_name = Text(
    '{name!r} is no name, allowed are at most {longest} characters that are no number, without '
    'quotes and double spaces')
other_unit = Text(
    '{name!r} has {unit}, allowed is an actual value with {wanted}, that of {parameter!r}',
    do='name an actual value of the same unit, or correct unit')
cannot_be_sent = Text('{name!r} cannot be sent, allowed is {kind}{allowed}')
name_of_other = Text(
    '{name!r} is the name of {other} too, allowed is another one',
    do='give one of the two another name')
cannot_be_written = Text('{value!r} cannot be written, allowed is {allowed}')
no_named_bits = Text(
    '{name!r} has no named bits, allowed is PARAMETER.BIT',
    do='write bits below that parameter, or name one that has them')

# -- what a family of drives knows
inverters_are_slow = Text(
    '{period:g} s is short: inverters take 1 to {answer:g} ms to answer; recommended is at '
    'least {least:g} s',
    do='raise period to what is recommended')
subindex_alone = Text(
    'a sub-index without a number, allowed is number with subindex, or neither',
    do='write number beside subindex')
process_data_stored = Text(
    'process data are not stored, allowed without a number is ram, or to leave it out',
    do='delete storage, or write ram')
no_process_word = Text(
    '{type} does not fit a process word, allowed without a number are bool, int16, uint16')
request_differs = Text(
    'differs from that of {leader}, allowed is the same',
    do='write the same cyclic_request for all drives of the group')
period_differs = Text(
    '{period:g} s differs from {other:g} s of {leader}, allowed is the same',
    do='write the same period for all drives of the group')
too_many_parameters = Text(
    '{count} parameters are too many, allowed are at most {most}{more}',
    do='shorten the list; read the others as parameters')
option_differs = Text(
    '{value} differs from {other} of {leader}, allowed is the same',
    do='write the same value for all drives of the group')
led_by_other = Text(
    'commands go to {leader}, allowed is to leave it out',
    do='leave cyclic_request out, and command the leader')
both_broadcasts = Text(
    "'{mine}', while drive {drive} on the same bus has '{other}' and inverters obey both; "
    "allowed is '{other}' or 'none'",
    do='write the same broadcast for all drives of the bus')
not_16_bits = Text("'{name}' is {type}, process words carry bool, int16 or uint16")
type_differs = Text(
    "'{name}' has another type, scale, offset or unit than for {leader}, allowed is the same")
range_differs = Text(
    "'{name}' has another minimum, maximum or neutral than for {leader}, allowed is the same")
limit_differs = Text(
    "'{name}' has another limit (true or false) than for {leader}, allowed is the same")
predefined_identifier = Text(
    '{identifier:03X}h is {taken} in the predefined connection set: a device that was not set '
    'up for it takes or sends something else there; predefined_set: false says that this one was',
    do='write predefined_set: false if this device was set up like that, or another identifier')
identifier_of_node = Text(
    '{identifier:03X}h is the identifier of the {purpose} of this node, allowed is any other',
    do='write another identifier, or leave the key out')
subindex_missing = Text(
    'missing, allowed with index is 0 to {most}',
    do='write subindex beside index')
address_missing = Text('missing, allowed in {family} with addressing {addressing} is {what}')
last_register = Text(
    '{type} takes two registers and {address} is the last one, allowed is a 16-bit type')
shared_register = Text("'{name}' and '{other}' share a register, allowed is one of them")
vl_only = Text(
    "is for mode vl only, '{mode}' has no such bits",
    do='write mode: vl, or leave the key out')
pp_halts = Text(
    '{timeout:g} s: in pp a target that is not published again within it halts the axis on its '
    'way; publish it continuously, or set 0',
    do='publish targets continuously, or write command_timeout: 0.0')
one_missing = Text(
    'missing, allowed is one of {allowed}',
    do='write one of the keys that are allowed')
interpolated = Text(
    "'{name}' is interpolated by the drive from setpoint to setpoint, allowed is a period of at "
    'most {most:g} s')
ip_by_event = Text(
    "'event' is nothing for mode ip, which goes from SYNC to SYNC, allowed is transmission: sync",
    do='write transmission: sync, or leave it out')
interpolated_by_event = Text(
    "'event' with mode {mode}: the drive interpolates from SYNC to SYNC, and without it every "
    'jitter of the bridge moves the axis',
    do='write transmission: sync, or leave it out')
period_jitters = Text(
    '{period:g} s: a process without a real-time kernel jitters by tenths of a millisecond',
    do='write a period of at least 0.001 s, or run a real-time kernel')
no_event_timer = Text(
    '{period:g} s is no event timer, allowed with transmission: event are whole milliseconds '
    'up to {most:g} s')
heartbeat_too_short = Text(
    '{timeout:g} s is not longer than heartbeat_producer ({producer:g} s), allowed is more, or 0',
    do='write a longer heartbeat_timeout: two or three times heartbeat_producer')
setpoint_of_other_mode = Text(
    "'{name}' is the setpoint of another mode than '{mode}'",
    do='leave it out of cyclic_request, or correct mode')
pdo_twice = Text('a PDO stands twice, allowed is once', do='write each PDO once')
pdos_too_small = Text(
    '{count} PDO{plural} of 8 bytes cannot carry {listed}, needed are {needed}: write {write}',
    '{count} PDO{plural} of 8 bytes cannot carry {listed}, needed are {needed}, and there are no '
    'more: leave entries away',
    do='write more PDOs (request_pdos, response_pdos) as the text says, or shorten the list')
setpoint_missing = Text(
    "mode '{name}' has its setpoint in {index:04X}h.{subindex:02X}h, which is missing, allowed is "
    'to add {parameter}',
    "mode '{name}' has its setpoint in {index:04X}h.{subindex:02X}h, which is missing, allowed "
    'is to add it',
    fields='name index subindex parameter',
    do='add that parameter to cyclic_request')
setpoint_limit = Text(
    '{name!r} is the setpoint of {mode}, which is no limit; allowed in what bounds the drive')
setpoint_type = Text(
    '{type}, the setpoint of {name} is {wanted}',
    do='correct type in the profile')
time_too_short = Text('{seconds:g} s is too short, allowed is 0, or at least 0.001 s')
period_of_sync = Text(
    '{period:g} s differs from {other:g} s of drive {drive}, which hears the same SYNC; '
    'allowed is the same',
    do='write the same period for all drives of the bus that hear SYNC')
bridge_node_differs = Text(
    '{node} differs from {other} of drive {drive} on the same bus, allowed is the same',
    do='write the same bridge_node for all drives of the bus')
index_missing = Text(
    'missing, allowed in {family} is an index, with a subindex unless that is 0',
    do='write index: 0x6041, from the manual or the EDS of the drive')
no_numbers = Text(
    '{family} knows no numbers, allowed is index with subindex',
    do='write index and subindex in place of number')
no_index = Text("'{name}' has no index, allowed in a PDO are objects")
no_neutral_position = Text(
    'missing: a position has no value that is neutral everywhere; allowed in {name} is the '
    'name of the actual position, with an arming_tolerance',
    do=_NEUTRAL_FROM)
node_of_drive = Text(
    '{node} is the station of drive {drive}, allowed is a node-ID that no drive has',
    do='write another bridge_node')
mapped_already = Text("'{name}' is {taken}, allowed is to leave it out")
status_word_mapped = Text(
    "'{name}' is the status word, which is published by itself, allowed is to leave it out",
    do='delete it from the list')
period_too_fast = Text(
    '{period:g} s is too fast, allowed is at least {least:g} s unless allow_fast_cycle is true',
    do='raise period, or write allow_fast_cycle: true if drive and bus can do it')
maps_overlap = Text(
    '{request} and {response} overlap, allowed is a distance of {distance} or more',
    do='write bases that are further apart')
map_out_of_range = Text(
    '{base} with parameter_offset {offset} is out of range, allowed on the wire is 0 to {most}')
same_number = Text("'{name}' and '{other}' are both {address}, allowed is one of them")
number_missing = Text(
    'missing, allowed in {family} is 0 to {most}',
    do='write number: from the manual of the drive')
no_subindex = Text('{family} knows no sub-index, allowed is number alone', do='delete subindex')
mapping_parameter = Text(
    "'{name}' ({address}) is a mapping parameter, allowed are others than {base} to {last}",
    do='delete it from the list: the bridge reads and writes the maps itself')
moved_out = Text(
    "{offset} moves '{name}' ({address}) out of the allowed 0 to {most}",
    do='write a parameter_offset that keeps every number of the profile in that range')
access_impossible = Text(
    '{access} is impossible, {name} is never written; allowed is ro',
    do='write access: ro')
too_many_slots = Text(
    '{count} parameters are too many, allowed are at most {most}',
    do='shorten the list')
number_zero = Text("'{name}' has number 0 on the wire, which ends a map; allowed is 1 to {most}")
station_out_of_range = Text(
    '{station} is out of range, allowed is 1 to {most} ({family})',
    do='write the station that the drive has (its manual says where it is set)')
same_base = Text('{base} is request_id_base, too: allowed are bases that differ')
identifier_too_long = Text(
    '{station} is out of range: the identifier of {direction}s, {base:X}h + {station} = '
    '{identifier:X}h, does not fit 11 bits; allowed is 1 to {most} with these bases',
    do='lower the bases, or the station')
no_such_type = Text(
    '{type} does not exist in {family}, allowed are {allowed}',
    do='write one of the types that are allowed')
built_in = Text(
    "'{name}' is built in for {family}, allowed is any other name",
    do='give the parameter another name, or delete it: the protocol has it already')

#: all complaints there are, by their codes
CODES = catalogue(globals(), do='correct the file as the text says, and validate it again')


#: what is called otherwise by other stacks, and by people: our word -> theirs
_OTHER_WORDS = {
    'station': 'node_id nodeid node-id node can_id id address slave slave_id unit unit_id',
    'bitrate': 'baudrate baud baud_rate bit_rate speed',
    'channel': 'port device dev',
    'interface': 'type bustype adapter driver',
    'protocol': 'family driver profile_type',
    'profile': 'eds eds_file dcf parameter_table table',
    'period': 'cycle cycle_time interval rate frequency sync_period',
    'cyclic_request': 'setpoints commands rpdo request outputs',
    'cyclic_response': 'feedback actual_values tpdo response inputs',
    'command_timeout': 'timeout watchdog',
    'mode': 'operation_mode mode_of_operation modes_of_operation',
    'cia402': 'ds402 dsp402 dsp-402 cia_402 cia-402 402 servo',
    'cannord': 'nord',
    'canopen_pkw': 'tesys tesys_t ltmr pkw',
    'datamodel_extended': 'datamodel',
}
_OURS: dict[str, list[str]] = {}
for _our, _theirs in _OTHER_WORDS.items():
    for _their in _theirs.split():
        _OURS.setdefault(_their, []).append(_our)


def called_otherwise(ours: str, written: Iterable[str]) -> str | None:
    """Return what other stacks, or people, call what we call ``ours``, if it is there."""
    return next((word for word in written if ours in _OURS.get(word.lower(), ())), None)


def _meant(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that is meant by another one, or None."""
    words = list(known)
    folded = word.lower()
    return next((each for each in (folded, *_OURS.get(folded, ())) if each in words),
                nearest(word, words))


def hint(word: str, known: Iterable[str]) -> Sentence:
    """Return the known word that was probably meant, in brackets; empty if there is none."""
    match = _meant(word, known)
    return near(word=match) if match else NOTHING


def suggestion(word: str, known: Iterable[str]) -> Sentence:
    """Return the end of a sentence on an unknown word: the nearest known one, or all."""
    words = list(known)
    match = _meant(word, words)
    if match is not None:
        return did_you_mean(word=match)
    if not words:
        return nothing_allowed()
    more = ' …' if len(words) > _WORDS_MAX else ''
    return allowed(words=', '.join(words[:_WORDS_MAX]) + more)


def suggestion_of_profile(word: str, known: Iterable[str], profile: str = '') -> Sentence:
    """
    Return the same about a name that a profile lacks, where there may be hundreds.

    :param profile: what it is called; '': the file that has the word.
    """
    words = list(known)
    if len(words) <= _NAMES_MAX or _meant(word, words) is not None:
        return suggestion(word, words)
    few = ', '.join(difflib.get_close_matches(word, words, n=_NAMES_NEAREST, cutoff=0.0))
    # drive_can profile shows nothing of a profile with problems
    return (some_allowed(words=few, profile=shlex.quote(profile)) if profile
            else some_allowed_here(words=few))
