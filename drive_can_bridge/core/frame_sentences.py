# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Texts about single frames, and about the results of scan and probe, each with its code.

Rows as in :mod:`.sentences`.
"""

from drive_can_bridge.core.messages import catalogue, Text

_STRANGER = 'see who else sends on this identifier: a second master, a second station, a test tool'
_FIRMWARE = ('see whether something else answers with this station; if it is the drive, report '
             'it, with a trace (drive_can record)')
_EVIDENCE = 'nothing: it is what the conclusion rests on'
_ASK_AGAIN = 'look at cable and station, then ask again; or read it in the manual'

# -- frames that cannot be understood -------------------------------------------------------------
not_29_bit = Text('{frame}: not a 29-bit identifier', do=_STRANGER)
not_11_bit = Text('{frame}: not an 11-bit identifier', do=_STRANGER)
length_differs = Text(
    '{frame}: {length} data bytes instead of {wanted}',
    '{length} data bytes instead of {wanted}',
    fields='length wanted frame',
    do='see whether the drive and the file mean the same protocol; length_policy: lenient takes '
       'shorter ones where there is that key')
telegram_length = Text('{what} with {length} data bytes instead of {wanted}', do=_FIRMWARE)
words_missing = Text(
    '{frame}: {length} data bytes do not hold {count} words',
    '{length} data bytes do not hold {count} words',
    fields='length count frame', do=_FIRMWARE)
bytes_missing = Text(
    '{length} data bytes, {needed} needed',
    do='compare cyclic_response with what the drive sends: its map is shorter')
write_acknowledged = Text('{frame}: drives do not acknowledge writes', do=_STRANGER)
count_impossible = Text('{frame}: parameter count {count} is not 1 to {most}', do=_STRANGER)
numbers_past_end = Text('{frame}: parameters {first} to {last} run past 65535', do=_STRANGER)
not_from_station = Text('{frame}: not from station {station}', do=_STRANGER)
unknown_function = Text('{frame}: function {code} is neither {read} nor {write}', do=_STRANGER)
sdo_given_up = Text(
    'SDO response {data} to what was given up',
    do='raise parameter_timeout: the drive answers later than that')
sdo_out_of_turn = Text('SDO segment out of turn', do='look for a second SDO client of this node')
sdo_request_unknown = Text('SDO command {command:02X}h is no request that is known here',
                           do=_STRANGER)
sdo_answer_unknown = Text('SDO command {command:02X}h is no answer that was asked for',
                          do='look for a second SDO client of this node')
sdo_no_upload = Text('SDO command {command:02X}h is no answer to an upload',
                     do='look for a second SDO client of this node')
heartbeat_empty = Text('heartbeat without content', do=_FIRMWARE)
heartbeat_unknown = Text('heartbeat with unknown state {state:02X}h', do=_FIRMWARE)
other_task_answered = Text(
    'parameter response {response} for P{number}.{index} does not belong to task {task} for '
    'P{asked}.{asked_index}',
    do='look for a second master; index_byte and value_order may be others (drive_can probe)')
other_value_echoed = Text(
    'response to writing P{number}.{index} with another value',
    do='read the parameter; value_order may be the other one (drive_can probe)')
process_data_length = Text(
    '{length} data bytes: process data have {short} or {long}', do=_FIRMWARE)
extra_data_length = Text(
    '{length} data bytes: the additional process data have {wanted}', do=_FIRMWARE)
parameter_frame_length = Text(
    '{length} data bytes: parameter frames have {wanted}', do=_FIRMWARE)
task_bit_set = Text(
    'bit 11 of the task identifier is set',
    do='nothing: the inverter tells by itself of a value that has changed; switch that off at it')

# -- drive_can decode: what it remarks of a telegram ----------------------------------------------
broadcast_of_others = Text(
    'of another master: the file has no drive with this broadcast',
    do='write broadcast: for its drives, or see who sends it')
fewer_values = Text(
    '{found} values, {needed} needed; {remark}',
    do='compare cyclic_response with the settings of the inverter')
said_unasked = Text(
    '{remark}, sent by the drive without a request', do='nothing: a fault is sent at once')
response_to_task = Text('response {response} to task {task}', do='see the manual of the inverter')
same_function_byte = Text(
    'the function byte is that of the request before: nothing is started',
    do='nothing for a bridge; another master has to change the toggle bit')
unknown_function_code = Text('unknown function {code:02X}h', do=_STRANGER)
unknown_command = Text('unknown command {command:02X}h', do=_STRANGER)
device_started = Text(
    'the device has started', do='see why it has started again: power, watchdog, reset')
segment_unanswered = Text('no answer to a segment', do='look at the cable; ask again')
unanswered_for = Text(
    'no answer in {milliseconds:.0f} ms',
    do='look at power and cable of the drive; longer periods where the bus is full')
eeprom_written_fast = Text(
    'EEPROM write {distance:.1f} ms after the last, the drive wants {gap:g} ms',
    do='write more slowly: the drive loses it; eeprom_write_gap of the bridge')

# -- drive_can scan and probe: what their questions would mean to others --------------------------
hazard_cannord = Text(
    'a task on 200h + 2·address is RPDO1 (process data) or TPDO of CANopen nodes, on 300h to 3FEh '
    'RPDO2 and TPDO3: a CANopen drive may take it for a command; an inverter whose P513 is not 0 '
    'supervises telegrams once it has got one',
    do='ask only where no CANopen device is on the bus, and nothing may move')
hazard_standard = Text(
    'a read on 3F1h to 3FFh looks like TPDO3 of CANopen nodes 113 to 127, and on even stations '
    'like a task that reads, to CANnord inverters 249 to 255',
    do='ask only where no such device is on the bus')
hazard_maps = Text(
    'a read of the maps on {identifier:03X}h is a write of a parameter in EEPROM to a CANnord '
    'inverter that has it as its identifier for parameter tasks',
    do='ask only where no such inverter is on the bus')

# -- drive_can scan and probe: what they found out ------------------------------------------------
seems_requests = Text(
    'what looks like requests of {protocol}',
    do='end the other master, or scan with --passive')
requests_to_station = Text('requests to station {station} of {protocol}',
                           do='end the other master, or scan with --passive')
sdo_requests_to = Text('SDO requests to node {node}',
                       do='end the other master, or scan with --passive')
process_data_for = Text('process data for node {node}',
                        do='end the other master, or scan with --passive')
map_not_exchangeable = Text(
    'its {name} map, {numbers}, cannot be exchanged: map other parameters, each once',
    do='map other parameters, each once')
contradiction = Text('{what} contradict each other: {told}',
                     do='read it in the manual; ask again while nothing else talks to the drive')
undecided = Text('undecided: {why}', do=_ASK_AGAIN)
supervises_telegrams = Text(
    'P513 is not 0: the inverter supervises telegrams once it has got one, and trips when they '
    'end',
    do='set P513 to 0 while you work without a bridge, or reset the fault afterwards')
no_tasks_answered = Text(
    'no answer to parameter tasks: check station, bit rate and extended_identifiers',
    do='check them, power and cable; P509 and P514 of the inverter say how it is set')
no_refusal_with_number = Text(
    'no array read was refused with an error number', do='read it in the manual of the inverter')
array_read_refused = Text(
    'array read of P{number}: {error}, in bytes {place} ({data})', do=_EVIDENCE)
parameter_reads = Text('read of P{number}: {value} ({data})', do=_EVIDENCE)
no_array = Text('no parameter is an array', do='read it in the manual of the inverter')
array_read = Text('array read of P{number}: {results:; }', do=_EVIDENCE)
subindex_in_byte = Text('sub-index {subindex} in byte {place}: {what}', do=_EVIDENCE)
not_twice = Text('no answer, or not twice the same', do=_ASK_AGAIN)
no_mailbox = Text(
    'receive PDO4 (1603h) maps {mapped:04X}h, no mailbox (3000h): nothing was asked',
    do='another protocol may fit this node; see drive_can scan')
layout_first = Text('the layout comes first', do='see what it says of layout')
node_silent = Text(
    'no answer: a node that is not operational answers no PKW (--nmt-start starts it); check '
    'station, bit rate, request_cob_id and response_cob_id',
    do='give --nmt-start where nothing else starts the node; else compare these with the drive')
one_value_only = Text(
    'one value is not enough: {told}; try again while the motor runs',
    do='try again while the motor runs')
no_telling_value = Text(
    'no value of 32 bits has one half that is 0 and one that is not; try again while the motor '
    'runs',
    do='try again while the motor runs')
reads_this_not_that = Text('{name} reads {data}: {values: and not }', do=_EVIDENCE)
refused_by_bytes = Text('{address} refused by {data}: {meaning}', do=_EVIDENCE)
nothing_refused = Text('nothing was refused', do='leave abort_code_order: auto')
no_known_code = Text(
    'refused without a code that is known in one order only: {told:; }',
    do='leave abort_code_order: auto')
no_answer_to_scan = Text(
    'no answer: check station, bit rate and power', do='check them, and the cable')
no_cia402 = Text(
    '1000h says {device:08X}h: no drive of CiA 402 (0192h in the lower half)',
    do='use the protocol of that device; see drive_can scan')
several_axes = Text(
    'there are {axes} axes behind this node ({told:, }): the bridge drives the first (6040h), and '
    'leaves the others alone',
    do='see in the manual whether the others can stand still by themselves')
modes_offered = Text(
    '6502h is {offered:08X}h: {names:, }',
    '6502h is {offered:08X}h: none of those known here',
    do='choose one of these as mode')
mapping_holds = Text(
    '{place} is mapped to {found}; the file wants {wanted}',
    do='mapping: configure lets the bridge write it')
mapping_fits = Text(
    'all PDOs are mapped as the file wants them; configure does no harm', do='nothing')
brakes_by_ramp = Text('{told}: {word} brakes by ramp', do='nothing')
manual_says = Text(
    '{told}: the manual says what {word} does',
    do='look that value up in the manual of the drive')
always_coasts = Text(
    '{told}: the axis coasts with every word; write 605Ch := 1 if it may be',
    do='write 605Ch := 1 where the drive takes it; else a brake has to hold the axis')
nothing_watches = Text(
    '{told}: the drive cannot watch the bridge, nothing stops it when the bridge dies',
    do='see in the manual for another watchdog; a safety circuit has to stop it')
no_heartbeat_places = Text('1016h has no places', do='see in the manual for another watchdog')
misses_without_effect = Text(
    '{told}: it does nothing when it misses the bridge; write 6007h',
    do='write 6007h (3: quick stop), and store it')
misses_unknown = Text(
    '{told}: what it does when it misses the bridge is not known',
    do='see in the manual what the drive does when its heartbeat is missing')
probed_object_unanswered = Text('{place} was not answered', do=_ASK_AGAIN)
probed_object_absent = Text('the drive has no {place}', do='nothing')
probed_object_refused = Text('{place} was refused: {why}', do='look the code up in the manual')
maps_are_there = Text('the maps of the file are there, {told}', do='nothing')
maps_nowhere = Text(
    'undecided: the maps of the file are nowhere, and that others were not answered proves '
    'nothing, {told}',
    do='compare cyclic_request and cyclic_response with the maps of the drive')
maps_unanswered = Text(
    'the maps are not answered; check request_map_base and response_map_base',
    do='compare these two keys with the manual of the drive')
maps_in_several = Text(
    'the maps of the file are in more than one place, {told}',
    do='read in the manual how the drive counts its parameters')
maps_ambiguous = Text(
    'the maps of the file are nowhere, and more than eight numbers answer, {told}',
    do='compare cyclic_request and cyclic_response with the maps of the drive')
scan_silent = Text('no answer: check station and bit rate', do='check them, power and cable')
offset_first = Text('parameter_offset comes first', do='see what it says of parameter_offset')
numbers_hold = Text('{place} hold {numbers}', do=_EVIDENCE)
profile_lacks = Text('{found}; the profile lacks {names:, }', do='add them to the profile')

#: all of them, by their codes
CODES = catalogue(globals())
