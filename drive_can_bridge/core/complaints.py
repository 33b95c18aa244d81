# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What can be wrong with a configuration or a profile: every sentence, by its code.

Rows as in :mod:`.sentences`; what to do is part of the text, which says what is allowed. The
place of the problem is not part of it.
"""

from collections.abc import Iterable

from drive_can_bridge.core.messages import catalogue, NOTHING, Sentence, Text
from drive_can_bridge.core.text import nearest

_WORDS_MAX = 30

# -- what may be meant instead
did_you_mean = Text("did you mean '{word}'?")
near = Text(" (did you mean '{word}'?)")
allowed = Text('allowed: {words}')
nothing_allowed = Text('nothing is allowed here')
allowed_below = Text('allowed is {entry} below it')
list_empty = Text('{listed} is empty')
no_profile_at_all = Text('there is no profile at all')
two_protocols = Text(' (a drive of CiA 402 is cia402, a Schneider TeSys T is canopen_pkw)')
to_be_imported = Text('a profile is made of it by: drive_can profile import {name} -o drive.yaml')

# -- values and keys
missing = Text('missing, allowed is {allowed}')
unknown_key = Text('unknown key, {hint}')
unknown_key_of_bridge = Text("unknown key, did you mean '{word}'? It is set by the bridge itself")
wrong_type = Text('{value!r} is {kind}, allowed is {allowed}')
wrong_kind = Text('{kind}, allowed is {allowed}')
number_in_words = Text('{value!r} is {kind}, allowed is {allowed}: write {number}')
word_as_bool = Text(
    '{value!r} is {kind} (so are on, off, yes and no without quotes), allowed is {allowed}: write '
    'it in quotes')
one_entry = Text('{value!r} is {kind}, allowed is {allowed}: write [{value}]')
not_finite = Text('{value!r} is not a finite number, allowed is {allowed}')
unknown_word = Text('{value!r} is unknown{near}, allowed is {allowed}')
out_of_range = Text('{value!r} is out of range, allowed is {allowed}')
value_out_of_range = Text('{value} is out of range, allowed is {least} to {most}{remark}')
wrong = Text('{value!r} is wrong, allowed is {allowed}')
useless = Text('{value!r} is useless, allowed is any other number')
empty_string = Text('an empty string, allowed is text')
number_of_values = Text('a list of {count} values, allowed are {allowed}')
empty_mapping = Text('an empty mapping, allowed is at least one entry')
too_many_entries = Text('a mapping of {count} entries, allowed are at most {allowed}')
key_of_others = Text('a key of {owners}, allowed with {family} is to leave it out')
not_while_running = Text(
    '{name} cannot change while the node runs; change the parameter file and restart')
unknown = Text('{name!r} is unknown, {hint}')
no_directory = Text('{name!r} is no directory')
no_home = Text('{value!r} begins with an unknown home directory, allowed is a path without ~')

# -- files
not_yaml = Text('not valid YAML: {what}')
indented_like_no_key = Text(
    'not valid YAML: {what} (no key above it is indented like it: is one missing?)')
tab = Text('a tab in the indentation, allowed are spaces')
too_deep = Text('nested too deep, allowed are {levels} levels')
no_section = Text(
    'no section of the file holds it, allowed is one /**/drive_can_bridge: {{ros__parameters: '
    '{{buses: …}}}}')
no_section_of = Text(
    'no section of the file holds it, allowed is one /**/drive_can_bridge: {{ros__parameters: '
    '{{buses: …}}}}; the file has: {names}')
second_section = Text(
    'in a second section, {section}; allowed is one section that holds it (the first is {first})')
is_profile = Text(
    'a profile, allowed is NODE_NAME: {{{entry}: …}}; drive_can profile check looks at profiles')
nothing_configured = Text(
    'node {node} got neither buses nor drives: give a parameter file with --ros-args '
    '--params-file FILE')
file_is_for = Text('{file} is for {nodes}')
no_mapping = Text('no mapping, allowed is NODE_NAME: {{{entry}: …}}')
no_mapping_refused = Text('no mapping (rcl refuses the file), {hint}')
without_head = Text(
    'stands at the beginning of the file, allowed is below /**/drive_can_bridge: and {entry}:, '
    'each indented by two more spaces')
no_parameters = Text('no mapping, allowed are parameters')
no_node_name_above = Text('no node name above it, allowed is NODE_NAME: {{{entry}: …}}')
no_node_name = Text(
    '{name!r} is no node name (rcl refuses the file), allowed is for example '
    '/**/drive_can_bridge')
key_no_node_name = Text('a key that is no name, allowed are node names')
beside_parameters = Text(
    'stands beside {entry} (rcl refuses or garbles the file), allowed is a section of its own')
misspelt = Text('misspelt, allowed is {allowed}')
other_node_name = Text(
    'fits no bridge that has its usual name, allowed is /**/{usual}, or a bridge that is '
    'started with this name')
other_namespace = Text(
    'counts for the bridge in another namespace, and is not checked: checked is {node}')
value_and_keys = Text(
    'has a value in one section, and keys below it in another; allowed is one of them')
value_and_below = Text("has a value, and '{below}' below it; allowed is one of them")
duplicate_key = Text('duplicate key, allowed is one (the first is in line {first})')
no_key = Text('{kind} as a key, allowed is a name')
empty_key = Text('an empty key, allowed is a name')
key_with_nul = Text('a key with a NUL character, allowed is a name')
dots = Text('a key with dots, allowed are nested keys')
alias = Text('an alias{why}, allowed is the value itself')
no_value = Text('no value{why}, allowed is a value, or [] for an empty list')
no_space = Text('no value{why}: a space is missing behind the colon, write {key}: {value}')
no_colon = Text('no value{why}: a colon is missing, write {key}: {value}')
not_below = Text(
    'no value{why}: the lines {first} to {last} stand beside it, not below it, indent them by two '
    'more spaces')
nul = Text('a NUL character, allowed is text without')
garbling_mapping = Text(
    'an empty mapping (rcl garbles what follows), allowed is to leave the key out')
nested_list = Text('a list or mapping in a list, allowed are plain values')
mixed_list = Text(
    '{value!r} is {kind} in a list that began with {first} (rcl refuses the file), allowed are '
    'values of one type')
more = Text('and {count} more')

# -- buses
no_interface = Text('{name!r} is no interface of python-can, {hint}')
channel_of_kernel = Text(
    '{name!r} is a SocketCAN device, allowed is interface: socketcan with channel: {name}')
channel_of_serial = Text(
    '{name!r} is a serial port, allowed is interface: slcan with channel: {name}')
driver_missing = Text(
    "the driver of interface '{interface}' is missing ({why}), allowed is one that is installed")
no_serial_port = Text(
    '{channel!r} is no serial port, allowed are a device such as /dev/ttyACM0, '
    'socket://HOST:PORT and rfc2217://HOST:PORT')
no_bitrate = Text('{bitrate} is impossible with {interface}, allowed is one of {allowed}')
adapter_does_not_name = Text(
    'the adapter for {interface} does not name this key{near}; it is handed over all the same')
adapter_needs = Text('the adapter for {interface} needs {keys:, }')
unknown_adapter = Text('{name!r} is unknown, {hint}; docs/adapters.md has them all')
adapter_of_other_interface = Text(
    '{name!r} is an adapter for {other}, allowed is interface: {other}, or to leave this key out')
adapter_drops = Text(
    '{adapter} never sends {what:, }, which drive {drive} needs ({protocol}); allowed is another '
    'adapter, or another firmware')
no_listen_only = Text(
    '{adapter} has no listen-only mode by this key; it has: {instead}',
    '{adapter} has no listen-only mode',
    fields='adapter instead')
only_listens = Text('the adapter only listens then: no drive is sent anything')
adapter_late = Text(
    '{period:g} s is too short for {adapter}, which keeps what it has received for up to '
    '{latency} ms: answers will be late; recommended is at least {least:g} s, or: {remedy}',
    '{period:g} s is too short for {adapter}, which keeps what it has received for up to '
    '{latency} ms: answers will be late; recommended is at least {least:g} s',
    fields='period adapter latency least remedy')
line_too_slow = Text(
    'the serial line to {adapter} has {rate} bit/s, of which these drives need up to '
    '{share:.0f} %, recommended is at most {most:.0f} %: longer periods, or a faster line')
channel_of_other_bus = Text(
    '{channel!r} is also the channel of bus {bus}; the load is checked for each bus alone')
port_of_other_bus = Text(
    '{channel!r} is the serial port of bus {bus}, too, allowed is a port of its own')
name_of_other_channel = Text(
    "bus {bus} has a channel of this name: decode takes what other programs' traces have of it "
    'for this bus')
overload = Text(
    'worst-case load {load:.1f} % at {bitrate} bit/s ({parts}), allowed is {most:.0f} %: use '
    'longer periods, fewer drives or a higher bit rate')
high_load = Text(
    'worst-case load {load:.1f} % at {bitrate} bit/s ({parts}), recommended is at most '
    '{most:.0f} %')

# -- drives
no_drive = Text('no drive is configured')
nobody_knows = Text('cannot be used, nobody knows why')
name_of_bridge = Text('{name!r} is the name of the bridge itself, allowed is any other')
topic_too_long = Text(
    '{topic} would have a name of {length} characters in ROS, with drive and namespace, '
    'allowed are {most}')
unknown_protocol = Text('{value!r} is unknown{near}; available: {allowed}')
no_protocol = Text('{value!r} is no protocol; available: {allowed}')
collides = Text(
    '{station} collides with drive {other} (station {other_station}) on bus {bus}: both use '
    '{purpose}; allowed is a station of its own')
told_by_two_buses = Text(
    '{bus!r} is the same as bus {other_bus}: drive {other} there and this one would hear the '
    '{what} of both; allowed is the bus of that drive')
period_too_short = Text(
    '{period:.9g} s is too short for a round of polling at {bitrate} bit/s, allowed is at '
    'least {least:.9g} s')
period_in_seconds = Text(
    '{period:g} s from one exchange to the next: it is in seconds, {period:g} ms are {shorter:g}')
not_in_profile = Text('{name!r} is not in the profile, {hint}')
twice = Text('{name!r} stands twice, allowed is once')
read_only = Text('{name!r} is read-only, allowed are parameters with access rw or wo')
write_only = Text('{name!r} is write-only, allowed are parameters with access ro or rw')
kept_in_eeprom = Text(
    '{name!r} is kept in EEPROM, which cyclic writing would wear out; allowed are parameters '
    'with storage ram')
empty_list = Text('empty, allowed in {family} is at least one parameter')
control_built_in = Text('control is built in for {family}, allowed is to leave it out')
control_word_limit = Text(
    '{name!r} is the control word, which is no limit; allowed in what bounds the drive')
no_neutral = Text(
    '{name!r} has no neutral value and raw 0 is out of its range, allowed is a neutral of '
    '{allowed}')
looks_like_limit = Text(
    '{name!r} looks like a limit, and is sent as {rest}{unit} until it is armed: if it bounds '
    'the drive and moves nothing, give it limit: true and a neutral in the profile')
control_word_held = Text(
    '{name!r} is the control word, which has no neutral_from; allowed in setpoints')
measured_not_listed = Text(
    '{name!r} is neutral at {measured!r}, which is not in cyclic_response, allowed is to add '
    'it there')
immediate_jumps = Text(
    "'immediate' would let {name!r} jump from {measured!r}, allowed with neutral_from is "
    "'neutral'")
broadcast_held = Text(
    '{broadcast!r} sends the same {name!r} to several axes, allowed with neutral_from is none')
status_missing = Text(
    '{name!r} is missing: without the status word the bridge cannot tell whether the drive is '
    'enabled')

# -- joints
no_quantity = Text('names no quantity, allowed is at least one of {allowed}')
not_in_list = Text('{name!r} is not in {listed}, {hint}')
control_word = Text('{name!r} is the control word, allowed is a setpoint')
joint_bounds = Text(
    '{name!r} is a limit: the zero that controllers end with would be a limit of zero, with '
    'which a drive cannot brake')
joint_commands_limit = Text(
    '{name!r} is a limit, which moves nothing, allowed is a setpoint; a limit has its own '
    'topic, ~/command/{name}')
is_bool = Text('{name!r} is a bool, allowed is a number')
does_not_convert = Text('{name!r} has {unit}, which does not convert; allowed is one of {allowed}')
quantity_already = Text('{name!r} is the {quantity} already, allowed is another parameter')
no_neutral_from = Text(
    '{name!r} has no neutral_from: without a command the axis goes to {neutral!r} {unit}, '
    'wherever it stands')
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
    '{name!r} is the joint of drives.{owner} already, allowed is a name of its own')

# -- profiles
no_file = Text('no file {name}, allowed is an existing one')
cannot_be_read = Text('{path} cannot be read ({why}), allowed is a readable file')
no_absolute_path = Text(
    '{name!r} is relative, and no parameter file sets it: write an absolute path ({meant})')
open_directory = Text(
    '{name!r} is beside a parameter file in a directory that everybody may write to: write an '
    'absolute path ({meant})')
name_with_suffix = Text('{name!r} is unknown, allowed is a name without {suffix}')
unknown_profile = Text('{name!r} is unknown, {hint} (searched: {places})')
profile_for_others = Text('{name!r} is for {protocols}, allowed is a profile for {family}')
no_profile = Text('no mapping, allowed are protocols, parameters, control, description')
is_parameter_file = Text(
    'parameters of nodes, allowed is a profile; drive_can validate looks at the file of a bridge')
second_document = Text('a second document, allowed is one')
write_only_one = Text('{name!r} is write-only, allowed is one with access ro or rw')
no_value_names = Text('{name!r} is {kind}, allowed in integers without scale, offset and unit')
write_only_bits = Text('{name!r} is write-only: its other bits cannot be kept, allowed is a value')
one_word = Text('{type} has one word, allowed in int32 and uint32')
beside_neutral_from = Text('stands beside neutral_from, allowed is one of them')
no_arming_tolerance = Text(
    'needs arming_tolerance: how far a command may be from where the axis is and still arm, '
    'allowed is to give it too')
read_only_in = Text('{name!r} is read-only, allowed in parameters with access rw or wo')
above_maximum = Text('{minimum!r} is above the maximum, allowed is at most {maximum!r}')
narrowed = Text('{limit!r} is not representable in {type}, narrowed to {end}')
read_only_one = Text('{name!r} is read-only, allowed is one with access rw or wo')
word_twice = Text('{word!r} is the word for {entry} too, allowed is another one')
mask_too_large = Text('mask {mask} does not fit {name}, allowed is 1 to {largest} ({type})')
mask_of_nothing = Text('mask 0 looks at no bit, allowed is a mask with at least one')
does_not_fit = Text('{entry} does not fit, allowed is {low} to {high}')
word_is_bool = Text('{word} without quotes is a bool, allowed is text: write it in quotes')
no_bit = Text('{bit!r} is no bit of {name}, {hint}')
name_taken = Text('{name!r} is taken by the node of the drive, allowed is any other name')
no_bool = Text('{value!r} is no bool, allowed is true or false')
no_such_bit = Text('bit {position} does not exist in {type}, allowed is 0 to {highest}')
no_neutral_of_limit = Text(
    'needs neutral: what is sent until the first command, allowed is to give it too')
no_actual_value = Text('{name!r} is no actual value, allowed is one that can be read')
no_value_between = Text(
    '{type}{scale} has no value in {limits}, allowed are limits around one (the nearest is '
    '{nearest})')
word_too_large = Text('{word} does not fit {name}, allowed is 0 to {largest} ({type})')
outside_mask = Text(
    'value {value} has bits outside of mask {mask} and never matches, allowed are bits of the '
    'mask')
number_twice = Text('{entry} stands twice (as {other}), allowed is once')
is_number = Text('{name!r} is a number, allowed is text')
fault_without_bit = Text(
    'bit is missing: without a control section nothing says when there is a fault, allowed is '
    'bit: PARAMETER.BIT')
raw_name = Text(
    '{name!r} reads as a raw parameter, allowed are names other than p<digits> and '
    'x<hexadecimal digits>')
bool_has_no = Text('a bool has no {entry}, allowed is to leave it out')
no_integer = Text('{limit!r} is no integer, allowed without scale, offset and unit are integers')
no_name = Text(
    '{name!r} is no name, allowed are at most {longest} characters that are no number, without '
    'quotes and double spaces')
other_unit = Text(
    '{name!r} has {unit}, allowed is an actual value with {wanted}, that of {parameter!r}')
cannot_be_sent = Text('{name!r} cannot be sent, allowed is {kind}{allowed}')
name_of_other = Text('{name!r} is the name of {other} too, allowed is another one')
cannot_be_written = Text('{value!r} cannot be written, allowed is {allowed}')
no_named_bits = Text('{name!r} has no named bits, allowed is PARAMETER.BIT')

# -- what only a family knows
inverters_are_slow = Text(
    '{period:g} s is short: inverters take 1 to {answer:g} ms to answer; recommended is at '
    'least {least:g} s')
subindex_alone = Text('a sub-index without a number, allowed is number with subindex, or neither')
process_data_stored = Text(
    'process data are not stored, allowed without a number is ram, or to leave it out')
no_process_word = Text(
    '{type} does not fit a process word, allowed without a number are bool, int16, uint16')
request_differs = Text('differs from that of {leader}, allowed is the same')
period_differs = Text('{period:g} s differs from {other:g} s of {leader}, allowed is the same')
too_many_parameters = Text('{count} parameters are too many, allowed are at most {most}{more}')
option_differs = Text('{value} differs from {other} of {leader}, allowed is the same')
led_by_other = Text('commands go to {leader}, allowed is to leave it out')
both_broadcasts = Text(
    "'{mine}', while drive {drive} on the same bus has '{other}' and inverters obey both; "
    "allowed is '{other}' or 'none'")
not_16_bits = Text("'{name}' is {type}, process words carry bool, int16 or uint16")
type_differs = Text(
    "'{name}' has another type, scale, offset or unit than for {leader}, allowed is the same")
range_differs = Text(
    "'{name}' has another minimum, maximum or neutral than for {leader}, allowed is the same")
limit_differs = Text(
    "'{name}' has another limit (true or false) than for {leader}, allowed is the same")
predefined_identifier = Text(
    '{identifier:03X}h is {taken} in the predefined connection set: a device that was not set '
    'up for it takes or sends something else there; predefined_set: false says that this one was')
identifier_of_node = Text(
    '{identifier:03X}h is the identifier of the {purpose} of this node, allowed is any other')
subindex_missing = Text('missing, allowed with index is 0 to {most}')
address_missing = Text('missing, allowed in {family} with addressing {addressing} is {what}')
last_register = Text(
    '{type} takes two registers and {address} is the last one, allowed is a 16-bit type')
shared_register = Text("'{name}' and '{other}' share a register, allowed is one of them")
vl_only = Text("is for mode vl only, '{mode}' has no such bits")
pp_halts = Text(
    '{timeout:g} s: in pp a target that is not published again within it halts the axis on its '
    'way; publish it continuously, or set 0')
one_missing = Text('missing, allowed is one of {allowed}')
interpolated = Text(
    "'{name}' is interpolated by the drive from setpoint to setpoint, allowed is a period of at "
    'most {most:g} s')
ip_by_event = Text(
    "'event' is nothing for mode ip, which goes from SYNC to SYNC, allowed is transmission: sync")
interpolated_by_event = Text(
    "'event' with mode {mode}: the drive interpolates from SYNC to SYNC, and without it every "
    'jitter of the bridge moves the axis')
period_jitters = Text(
    '{period:g} s: a process without a real-time kernel jitters by tenths of a millisecond')
no_event_timer = Text(
    '{period:g} s is no event timer, allowed with transmission: event are whole milliseconds '
    'up to {most:g} s')
heartbeat_too_short = Text(
    '{timeout:g} s is not longer than heartbeat_producer ({producer:g} s), allowed is more, or 0')
setpoint_of_other_mode = Text("'{name}' is the setpoint of another mode than '{mode}'")
pdo_twice = Text('a PDO stands twice, allowed is once')
pdos_too_small = Text(
    '{count} PDO{plural} of 8 bytes cannot carry {listed}, needed are {needed}: write {write}',
    '{count} PDO{plural} of 8 bytes cannot carry {listed}, needed are {needed}, and there are no '
    'more: leave entries away')
setpoint_missing = Text(
    "mode '{name}' has its setpoint in {index:04X}h.{subindex:02X}h, which is missing, allowed is "
    'to add {parameter}',
    "mode '{name}' has its setpoint in {index:04X}h.{subindex:02X}h, which is missing, allowed "
    'is to add it',
    fields='name index subindex parameter')
setpoint_limit = Text(
    '{name!r} is the setpoint of {mode}, which is no limit; allowed in what bounds the drive')
setpoint_type = Text('{type}, the setpoint of {name} is {wanted}')
time_too_short = Text('{seconds:g} s is too short, allowed is 0, or at least 0.001 s')
period_of_sync = Text(
    '{period:g} s differs from {other:g} s of drive {drive}, which hears the same SYNC; '
    'allowed is the same')
bridge_node_differs = Text(
    '{node} differs from {other} of drive {drive} on the same bus, allowed is the same')
index_missing = Text('missing, allowed in {family} is an index, with a subindex unless that is 0')
no_numbers = Text('{family} knows no numbers, allowed is index with subindex')
no_index = Text("'{name}' has no index, allowed in a PDO are objects")
no_neutral_position = Text(
    'missing: a position has no value that is neutral everywhere; allowed in {name} is the '
    'name of the actual position, with an arming_tolerance')
node_of_drive = Text(
    '{node} is the station of drive {drive}, allowed is a node-ID that no drive has')
mapped_already = Text("'{name}' is {taken}, allowed is to leave it out")
status_word_mapped = Text(
    "'{name}' is the status word, which is published by itself, allowed is to leave it out")
period_too_fast = Text(
    '{period:g} s is too fast, allowed is at least {least:g} s unless allow_fast_cycle is true')
maps_overlap = Text(
    '{request} and {response} overlap, allowed is a distance of {distance} or more')
map_out_of_range = Text(
    '{base} with parameter_offset {offset} is out of range, allowed on the wire is 0 to {most}')
same_number = Text("'{name}' and '{other}' are both {address}, allowed is one of them")
number_missing = Text('missing, allowed in {family} is 0 to {most}')
no_subindex = Text('{family} knows no sub-index, allowed is number alone')
mapping_parameter = Text(
    "'{name}' ({address}) is a mapping parameter, allowed are others than {base} to {last}")
moved_out = Text("{offset} moves '{name}' ({address}) out of the allowed 0 to {most}")
access_impossible = Text('{access} is impossible, {name} is never written; allowed is ro')
too_many_slots = Text('{count} parameters are too many, allowed are at most {most}')
number_zero = Text("'{name}' has number 0 on the wire, which ends a map; allowed is 1 to {most}")
station_out_of_range = Text('{station} is out of range, allowed is 1 to {most} ({family})')
same_base = Text('{base} is request_id_base, too: allowed are bases that differ')
identifier_too_long = Text(
    '{station} is out of range: the identifier of {direction}s, {base:X}h + {station} = '
    '{identifier:X}h, does not fit 11 bits; allowed is 1 to {most} with these bases')
no_such_type = Text('{type} does not exist in {family}, allowed are {allowed}')
built_in = Text("'{name}' is built in for {family}, allowed is any other name")

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


def _meant(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that is meant by another one, or None."""
    words = list(known)
    folded = word.lower()
    return next((each for each in (folded, *_OURS.get(folded, ())) if each in words),
                nearest(word, words))


def hint(word: str, known: Iterable[str]) -> Sentence:
    """Write the known word that is meant as a remark in brackets, or nothing."""
    match = _meant(word, known)
    return near(word=match) if match else NOTHING


def suggestion(word: str, known: Iterable[str]) -> Sentence:
    """Write the end of a sentence on an unknown word: the nearest known one, or all."""
    words = list(known)
    match = _meant(word, words)
    if match is not None:
        return did_you_mean(word=match)
    if not words:
        return nothing_allowed()
    more = ' …' if len(words) > _WORDS_MAX else ''
    return allowed(words=', '.join(words[:_WORDS_MAX]) + more)
