# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Texts about drives, requests and stops, each with its code.

Each row is a text with its fields in braces, and what to do about it (:class:`.Text`).
docs/messages.md is made of them.
"""

from collections.abc import Mapping
from enum import Enum

from drive_can_bridge.core.host_sentences import APART, STANDS_STILL
from drive_can_bridge.core.messages import catalogue, Text


class Absence(Enum):
    """What an offline drive still sends, as far as a sentence shows."""

    SILENT = 'nothing, as far as is known'
    NO_HEARTBEAT = 'no heartbeat'
    ANSWERS = 'something: power and cable are in order'


def _milliseconds(late: float) -> str:
    return f'{1e3 * late:.{int(1e3 * late < 1.0)}f}'


def _by_name(raws: Mapping[str, int | None]) -> str:
    return ', '.join(f'{name} {"unknown" if raw is None else f"{raw:04X}h"}'
                     for name, raw in raws.items())


_ACTIVATE = 'activate the bridge: ros2 lifecycle set BRIDGE activate'
_MAPS_DIFFER = ('end the bridge, see what drive_can probe DRIVE --params-file FILE says of the '
                'maps, and correct the file or the drive; mapping: configure helps only where '
                'diagnostics offer it')

#: the same in other words
uncoded = Text('{text}', do='what the text says')

# -- requests: why a parameter was not read or written --------------------------------------------
no_answer = Text(
    'no answer in {timeout:g} s, {attempts:#attempt}',
    do='look whether the drive has this parameter, and at its cable; raise parameter_timeout '
       'for a slow one')
no_answer_briefly = Text('no answer', do='read it at the drive; see diagnostics of the drive')
no_answer_offline = Text(
    'no answer; drive offline',
    do='see what diagnostics say of the drive; power, cable, station, bit rate')
no_answer_because = Text('no answer: {reason}', do='ask again when the drive is online')
drive_offline = Text('drive offline', do='see what diagnostics say of the drive')
drive_offline_because = Text(
    'drive offline: {reason}',
    do='start the node (nmt_start), or wait until it is started by others')
bus_down = Text('bus down', do='see what diagnostics say of the bus; it is opened again by itself')
bridge_inactive = Text('bridge inactive', do=_ACTIVATE)
bridge_has_gone = Text(
    'no answer: its bridge has gone',
    do=f'{STANDS_STILL}; see why the bridge has ended')
not_sent = Text(
    'not sent: the bus takes no frames',
    do='look at cable, termination and bit rate; ask again')
no_result = Text('no result', do='ask again')
busy = Text('busy', do='ask again with fewer requests at a time')
sent_unacknowledged = Text(
    'sent; this protocol does not acknowledge writes',
    do='nothing, or set verify_writes to have it read back')
refused_by_drive = Text(
    'refused by the drive: {text}',
    fields='number text',
    do='look the code up in the manual of the drive')
read_back_differs = Text(
    'read back {found} instead of {wanted}',
    do='see whether the drive limits the value, or others write it too')
other_length = Text(
    'the drive answers with {length:#byte}, the profile says {listed}',
    do='correct the type in the profile')
too_long = Text(
    '{length:#byte}: only objects of 1 to 4 bytes are numbers',
    do="read texts with the maker's tool")
no_object = Text(
    'has no index in the profile, so no SDO reaches it',
    do='add its index to the profile, or leave it to the drives of the other protocol')
width_unknown = Text(
    'how many bits it has, nobody knows: it cannot be read, and is not in the profile; add it '
    'there',
    do='add the object to the profile, with its type')
not_in_one_frame = Text(
    'cannot be written in one frame, nothing was written: {fits}',
    do='use set_parameters, or fewer parameters')
nothing_written = Text('{why}; nothing was written', do='what the reason says')

# -- requests: why a value or a name is refused before any frame ----------------------------------
read_only = Text('read-only', do='nothing; the profile says so')
out_of_range = Text(
    '{value} is out of range: {allowed}',
    do='send a value inside that range; the profile has it as minimum and maximum')
too_many_bits = Text(
    'a number of {bits} bits is out of range: {allowed}',
    do='send a value inside')
wrong_type = Text('wrong type: {found}, expected {expected}', do='send a value of that type')
not_a_bool = Text('{value} is not a bool', do='send true or false')
not_a_number = Text('{value} is a bool, not a number', do='send a number')
not_finite = Text('{value} is not a finite number', do='look at what commands this drive')
nan_refused = Text(
    'nan is not a finite number (a negative integer in a float field may arrive so, too: write '
    '300.0, not 300)',
    do='look at what commands this drive')
misplaced_integer = Text(
    '{value} is what arrives when an integer was put into a float field: write 300.0, not 300',
    do='have its publisher write floating-point numbers')
not_an_integer = Text('{value} is not an integer', do='send a whole number')
not_carried = Text(
    '{value} is not representable: {type_name} carries {allowed}',
    do='send a value inside')
none_in_range = Text(
    '{value} is not representable: {type_name} has no value in {allowed}',
    do='correct minimum and maximum in the profile')
not_in_bits = Text(
    '{value} is not representable in {bits} bits: {low} to {high}',
    do='send a value inside')
raw_refused = Text('raw {value} of {name}: {reason}', do='send a value inside')
unknown_parameter = Text(
    'unknown parameter {name}, did you mean {nearest}?',
    'unknown parameter {name}',
    do='use a name of the profile, or a raw one')
use_enable = Text('use ~/enable', do='call the service; the control word is not written by hand')
bridge_sets_mode = Text(
    'the bridge sets the mode: key mode of the drive in the parameter file',
    do='change that key, and start the bridge again; the drive gets it before its first cycle')
sent_cyclically = Text(
    'sent cyclically: publish ~/command/{name}',
    do='publish it: the bridge sends it each cycle')
sent_by_group = Text(
    'sent cyclically by the broadcast group: publish {leader}/command/{name}',
    fields='name leader',
    do='command the leader of the group: its drives get the same frame')
mapping_parameter = Text(
    'mapping parameter: not written while the bridge is active',
    do='deactivate the bridge, or use mapping configure')
joint_quantity_ignored = Text(
    'joint_command has a {quantity}, which is ignored: joint.{quantity}_command is not '
    'configured',
    do='configure it, or do not publish it')
joint_not_named = Text(
    'joint_command without an entry named {joint}',
    do='publish a JointState that has the joint')
clock_of_publisher_set = Text(
    '{topic}: the clock of its publisher was set back by {seconds:.2f} s; its setpoints are '
    'disarmed, and commands count again from here',
    do='arm it again; synchronise the clocks of the hosts')
steadily_late = Text(
    '{topic}: all that came for 10 s was {seconds:.2f} s later than others have (a clock was set, '
    'a quicker publisher is gone, or the network stays slower); its setpoints are disarmed, and '
    'commands count again from here',
    do='arm it again; synchronise the clocks of the hosts, or see what slows the network down')
clocks_differ = Text(
    'command on {topic} thrown away: the clocks of its publishers differ by {seconds:.2f} s: '
    'synchronise the clocks of the hosts',
    do='synchronise the clocks of the hosts (chrony or ntp; chronyc tracking shows the '
       'difference)')

# -- control: what became of enable, disable, quick stop and fault reset --------------------------
no_control_section = Text(
    'the profile has no control section',
    do='add one, or enable the drive by its terminals')
nothing_commanded = Text('nothing is commanded', do='nothing')
neutral_without_control = Text('neutral; it has no control word', do='nothing')
neutral_unanswered = Text(
    'told to be neutral, but no answer to that in {timeout:g} s', do=STANDS_STILL)
disabled_instead = Text(
    '{outcome}; told to disable, the profile has no quick_stop word',
    do='nothing')
no_reset_word = Text(
    'no fault reset: the profile has no reset_fault word',
    do='reset it at the drive, or add reset_fault to the words of the control section')
reset_first = Text(
    'fault {fault}: remove its cause, then reset it first (drive_can reset)',
    'fault: reset it first',
    do='remove the cause of the fault, then drive_can reset, or call ~/reset_fault')
fault_named = Text(
    'fault {number} {name}: remove its cause, then reset it',
    'fault {number}: remove its cause, then reset it',
    do='remove its cause, then call ~/reset_fault')
number_unread = Text('(number not read: {reason})', do='read it at the drive')
fault_unread = Text('fault (number not read: {reason})', do='read it at the drive')
replaced = Text('replaced by {action}', do='nothing; a newer call has the word')
stop_under_way = Text(
    '{stop} under way: try {action} again when it has ended',
    do='call again when the stop has been answered')
members_offline = Text('{names:, } offline', do='see what diagnostics say of these drives')
members_may_run = Text('{names:, } offline: it may still be running', do=STANDS_STILL)
group_is_led = Text(
    '{leader} leads the broadcast group: call ~/{service} of {leader}',
    do='call it there')
position_not_told = Text(
    '{name} does not have the value of {measured} yet{known:?}',
    ('{name} does not have the value of {measured} yet, which is not known or which it cannot '
     'carry'),
    do='see why the drive does not take, or does not tell, its position')
would_jump = Text(
    'it would jump: {why}',
    do='see why the drive does not take, or does not tell, its position')
status_word = Text('status word {raw:04X}h', do='look its bits up in the manual of the drive')
status_words = Text(
    'status words: {raws}',
    raws=_by_name,
    do='look their bits up in the manual of the drives')
no_status_word = Text('no status word', do='see why the drive does not answer')
state_reached = Text('{state}', do='nothing')
state_not_reported = Text(
    '{action} sent; the drive does not report its state',
    do='look at the drive; add a status condition to the profile where there is one')
reset_not_reported = Text(
    'reset_fault sent; the drive does not report faults',
    do='look at the drive: whether the fault has gone is not known')
fault_present = Text(
    ('fault {fault}: remove its cause, then reset it again; still present after {timeout:g} s '
     '({status})'),
    'fault still present after {timeout:g} s ({status})',
    fields='timeout status fault',
    do='remove its cause, then reset it again')
stuck = Text(
    'no confirmation in {timeout:g} s: stuck in state {state} ({status}); {remarks:; }',
    'no confirmation in {timeout:g} s: stuck in state {state} ({status})',
    do='see whether the drive stands; its manual says what leads out of that state; where a ramp '
       'takes longer, raise control_timeout')
voltage_disabled = Text(
    'voltage is disabled: power is missing, or safe torque off or an enable input keeps it off',
    do='look at the supply of the motor, at safe torque off (STO), and at the digital inputs')
quick_stop_active = Text(
    'a quick stop is active that this control word does not ask for: look at its digital inputs '
    'and at other sources of commands',
    do='look which digital input, or other source of commands, is set to quick stop')
bus_not_in_control = Text(
    'the bus is not in control: look at P509 and P510',
    do='look at P509 and P510')
word_not_acknowledged = Text(
    'control word {word:04X}h was not acknowledged',
    do='see why the drive does not answer')
word_not_sent = Text(
    'control word {word:04X}h could not be sent',
    do='see why the bus takes no frames')
no_status_since = Text(
    'no status word since control word {word:04X}h',
    do='see why the drive does not answer')
local_control = Text(
    'the drive is not under remote control: look at what gives it its commands',
    do='give CANopen the control of the drive')
quick_stop_holds = Text(
    '{state}, holds; enable takes the power off for some cycles: an axis without a brake sinks',
    do='disable or enable it to go on')
nothing_says_standing = Text(
    'nothing says that it stands',
    do='look whether the axis stands; have the drive tell 6064h or 606Ch')
error_code = Text('error code (603Fh) {code:04X}h', do="look the number up in the drive's manual")
target_not_acknowledged = Text(
    'it has not acknowledged its target: bit 12 of the status word is not {expected} after '
    '{timeout:g} s; the next target waits for it',
    fields='timeout expected',
    do='look in the manual what the drive wants before it takes a target')
bridge_missed = Text(
    'the drive missed the bridge: reset the fault',
    do='reset the fault; look why the bridge was silent')
mode_differs = Text(
    '6061h shows mode {shown} yet instead of {number} ({mode})',
    '6061h shows nothing yet instead of {number} ({mode})',
    fields='mode number shown',
    do='look in the manual when the drive changes its mode')
mode_not_shown = Text(
    'it has no 6061h: nobody knows whether it is in its mode',
    do='see in the manual how the drive shows its mode')
word_not_followed = Text(
    'it does not follow control word {word:04X}h',
    do="look at the drive's own inputs and its source of control words")
word_stays = Text('the word stays', do='nothing; the drive still brakes')
still_braking = Text(
    'still braking: the word stays',
    do='wait until it stands; see what diagnostics say of stops_by')
word_sent_last = Text('told {word:04X}h', do='see what keeps the drive in its state')
position_began_again = Text(
    'the position of {joint} begins again at {position:.6g} rad, as the drive has it',
    do='nothing, or tell what adds up its way (odometry) where the axis is')
no_homing = Text('this drive has no homing', do='look at its own ways to find a reference')
homing = Text('homing', do='wait until it has ended, or stop the drive')
homing_under_way = Text('homing is under way', do='wait until it has ended, or stop the drive')
homing_needs_enabled = Text(
    'enable it first: only an enabled drive looks for its reference',
    do='call ~/enable')
homing_needs_disarmed = Text(
    'it is armed: stop commanding it, until command_timeout has passed',
    do='end what publishes its commands, wait for command_timeout, call ~/home again')
homing_timed_out = Text(
    'homing not ended in {timeout:g} s: stopped {step}',
    do='look at method, speeds and switches (6098h, 6099h); raise homing_timeout')
homing_stopped = Text('homing stopped {step}', do='enable the drive and home it again')
fault_while_homing = Text(
    'homing stopped {step} by fault {fault}: remove its cause, reset it, enable the drive and '
    'home it again',
    'homing stopped {step} by a fault: remove its cause, reset it, enable the drive and home it '
    'again',
    fields='step fault',
    do='remove its cause, then call ~/reset_fault, ~/enable and ~/home')
homing_failed = Text(
    'the drive reports a homing error (bit 13)',
    do='look at method, speeds and switches (6098h, 6099h)')
homing_moves_on = Text(
    'the axis does not stand',
    do=f'{STANDS_STILL}; set a control_timeout longer than its ramp')
mode_refused = Text(
    'the drive does not change to mode {mode}',
    do='see whether the drive has that mode (6502h)')
homed = Text('homed', do='command it')
now_disable = Text('now disable', do='nothing; the drive is disabled instead')
word_refused = Text(
    'control word {word:04X}h {reason}',
    do='see that the drive takes control words from the bus (local control)')
fault_came = Text(
    'fault ({status}); only ~/enable starts the drive again{ran:?}',
    'fault ({status})',
    do='remove its cause, reset it, enable the drive')
fault_gone = Text('fault gone ({status})', do='nothing')
fault_while_enabling = Text(
    'fault {fault}: remove its cause, then reset it first; it came while enabling ({status})',
    'fault while enabling ({status}): reset it first',
    fields='status fault',
    do='remove its cause, then call ~/reset_fault')
dropped_out = Text(
    'no longer enabled, by itself ({status})',
    do='see what took the enable away at the drive')
dropped_out_for_good = Text(
    'no longer enabled, by itself ({status}); only ~/enable starts the drive again',
    do='see what took the enable away at the drive, then enable it')
enable_withdrawn = Text(
    'enable withdrawn: {reason}; only ~/enable starts {whom} again',
    do='enable the drive when it is there again')
status_missing = Text(
    '{answers:#answer} without a status word',
    do='see why the answers of the drive are short')
disregards = Text(
    'does not obey {action} ({word:04X}h): stop it by other means; still {state} ({status}); '
    'where its ramp is longer than control_timeout, set that longer',
    fields='state status action word',
    do=f'{STANDS_STILL}; then see whether it takes its control word from the bus (local control, '
       'inputs)')

# -- defects of this program ----------------------------------------------------------------------
internal_error = Text(
    'internal error: {kind}: {text}',
    do='report it, with the trace of the flight recorder')
partner_failed = Text('{name}: {why}', do='report it')

# -- stops ----------------------------------------------------------------------------------------
may_still_be_running = Text('{why}: it may still be running', do=STANDS_STILL)
stop_not_passed_on = Text(
    'a stop cannot be passed on to this bridge ({why}): its drives may still be running',
    do=f'stop it from its own host; {STANDS_STILL}')
no_answer_to_stop = Text('no answer in {seconds:g} s', do=STANDS_STILL)
nobody_takes = Text(
    'nobody offers its ~/{service}', do=f'{STANDS_STILL}; see whether its bridge runs')
stop_not_answered = Text('told to stop, but it does not answer', do=STANDS_STILL)
stop_failed = Text(
    'told to stop, but {what:; }',
    do=f'{STANDS_STILL}; then look at what stands behind "but"')
still_in_state = Text(
    'it is still in state {state}',
    do='stop the drive at its own panel, or by its power')
stop_not_possible = Text('could not be told to stop', do=STANDS_STILL)
bus_lost_before_stop = Text('the bus was lost before it could be told to stop', do=STANDS_STILL)
ends_before_stop = Text(
    'the bridge ends before the drive has confirmed its stop', do=STANDS_STILL)
position_unknown = Text(
    'where its axis is, nobody knows, so that it is told nothing', do=STANDS_STILL)
stopped_again = Text('told to stop once more, which it has confirmed', do='nothing')
no_answer_for_map = Text(
    'no answer for map parameter {number}',
    do='see why the drive does not answer')
write_unanswered = Text('{what}: no answer', do='see why the drive does not answer')
write_not_taken = Text('{what} not taken by the bus', do='look at cable, termination and bit rate')
write_not_acknowledged = Text(
    '{what} not acknowledged in {attempts:#attempt}',
    do='look at power, cable and station of the drive; see its diagnostics')
node_may_be_stopped = Text(
    'a node that NMT has stopped answers no SDO: only an NMT command (pre-operational, start) of '
    'its own master helps',
    do='have its NMT master send pre-operational or start, or cut its power')
write_read_back = Text(
    '{what}: read back {found} instead of {wanted}',
    do='see who else writes it')
write_refused = Text('{what} {reason}', do='look the code up in the manual of the drive')

# -- why a drive is offline, and what to look at --------------------------------------------------
not_activated = Text('not activated', do=_ACTIVATE)
deactivated = Text('deactivated', do=_ACTIVATE)
looked_for = Text(
    'being looked for',
    do='wait a moment; where that stays, check power, cable, station and bit rate')
set_up_unanswered = Text(
    'no answer to SDO: drive silent, wrong station or bit rate',
    kinds=(Absence.SILENT,),
    do='look at power, cable, node-ID and bit rate')
object_unanswered = Text(
    'no answer to SDO of {what}, others are answered',
    do='see whether the drive has that object: one that it lacks has to be refused (06020000h)')
found_enabled = Text(
    'found in state {state}: it is disabled before anything else',
    do='find out what has enabled it')
found_braking = Text(
    'found in state {state}: it is not touched before that has ended',
    do='wait until the motor stands; then see which fault it is')
found_running = Text(
    'told to stop by SDO, and still in state {state}: it is not cycled',
    do='stop the drive at its own panel, or by its power')
bus_is_down = Text(
    'bus {bus} is down',
    fields='bus reason',
    do='see what diagnostics say of the bus')
reconnected = Text('the drive is being reconnected', do='nothing')
bridge_stood_still = Text('the bridge stood still', do='see what else the computer does')
silent_for_cycles = Text(
    '{what} for {cycles} cycles',
    kinds=(Absence.SILENT,),
    do='power, cable, station, bit rate')
no_round = Text(
    'no complete round of reads for {periods} periods',
    kinds=(Absence.SILENT,),
    do='power, cable, station, bit rate; a longer period for a slow drive')
device_restarted = Text('the device restarted', do='see why it lost its power')
no_heartbeat = Text(
    '{answers:?}answers, but there is no heartbeat for {timeout:g} s',
    'no heartbeat for {timeout:g} s',
    fields='timeout answers',
    kinds=(Absence.ANSWERS, Absence.NO_HEARTBEAT),
    do='power, cable; the producer of the device (1017h)')
sync_not_begun = Text(
    'SYNC begins when every drive of the bus that hears it is known not to be enabled, was told '
    'to stop, or is silent',
    do='wait a moment; see what the other drives of the bus say')
sync_may_start = Text(
    '{refusal}: a SYNC may start what an RPDO from before has left in the drive',
    do='keep away from the motor; switch the drive off and on')
sync_watched = Text(
    'the drive watches SYNC (1006h = {period} us): one cycle that is late by {late:.4g} s is a '
    'fault for it',
    do='keep the computer from being late (real-time priority), or set 1006h to 0 in the drive')
node_state = Text(
    '{answers:?}answers, but is {state}: {emergency}',
    '{answers:?}answers, but is {state}',
    'node is {state}',
    fields='state answers emergency',
    kinds=(Absence.ANSWERS, Absence.ANSWERS, Absence.SILENT),
    do='start the node (nmt_start); remove the cause of an emergency')
answers_without = Text(
    'answers, but there is {lacks}: {emergency}',
    'answers, but there is {lacks}',
    fields='lacks emergency',
    kinds=(Absence.ANSWERS,),
    do='see what its PDOs are (mapping); remove the cause of an emergency')
answers_otherwise = Text(
    'answers, but not as CANopen has it: {what}',
    kinds=(Absence.ANSWERS,),
    do='look for another device with its identifiers; see what its manual says of CANopen')
pdo_length = Text(
    'TPDO {number} has {found:#byte} instead of {wanted}',
    kinds=(Absence.ANSWERS,),
    do='let the bridge write its mapping (mapping configure), or correct the lists')
silent = Text(
    '{what}: {look_at}',
    kinds=(Absence.SILENT,),
    do='look at what it names')
lost_because = Text('{why}: {gap}', do='correct cyclic_response: take out what the drive lacks')
maps_unread = Text(
    'no answer to mapping read: drive silent, wrong station, bit rate or identifier mode',
    do='check power, cable, station and bit rate; drive_can scan shows which drives answer')
cycles_unanswered = Text(
    'no cyclic response: drive silent or response identifier taken',
    kinds=(Absence.SILENT,),
    do='check power, cable and station; see whether another station has the same number')
reads_unanswered = Text(
    'no answer to reads: drive silent, wrong station, bit rate or identifier mode',
    kinds=(Absence.SILENT,),
    do='check power, cable, station and bit rate; drive_can scan shows which drives answer')
rounds_unanswered = Text(
    'no complete round of reads: drive silent, not operational, or other COB-IDs than configured',
    kinds=(Absence.SILENT,),
    do='check power, cable and node-ID; start the node (nmt_start), compare the COB-IDs '
       '(drive_can probe)')
one_read_unanswered = Text(
    'no answer to the read of {names}, though others are answered: does this drive have it',
    do='take it out of cyclic_response, or correct its number in the profile')
restarted_waiting = Text(
    'the device restarted: waiting for it to answer',
    do='wait; where it restarts again and again, see its power supply')

# -- maps -----------------------------------------------------------------------------------------
mapping_differs = Text('mapping differs: {how}', do=_MAPS_DIFFER)
of_object = Text(
    '{what}: {why}',
    do='take it out of cyclic_request or cyclic_response, or correct it in the profile')
no_such_object = Text(
    'no such object',
    do='see the manual of the drive, or its EDS, for the objects that it has')
limit_without_effect = Text(
    '{what} stays {shown} although {sent} is sent: the limit is not in effect',
    do='take it out of cyclic_request and set it as a parameter, or correct the drive')
limit_in_vain = Text(
    '{why}; disarmed: disable the drive',
    do='disable the drive; it is not enabled again before the limit is in effect')
limit_otherwise = Text(
    '{what} is {shown} although {sent} is sent',
    do='look which other limit of the drive bounds this one')
limit_unread = Text(
    '{what} has not been read back yet',
    do='wait; where it lasts, look at the cable and raise parameter_timeout')
object_refused = Text(
    '{what} ({meant}) refused by the drive: {why}',
    '{what} refused by the drive: {why}',
    fields='what why meant',
    do='take other parameters, or PDOs that fit what the drive has (mapping verify, assume)')
object_differs = Text(
    '{what} is {found} instead of {wanted}',
    do='set the drive up like that, or let the bridge do it (mapping configure)')
no_such_pdo = Text(
    'the drive has no {kind}{number}',
    do='choose PDOs that it has (request_pdos, response_pdos)')
not_pre_operational = Text(
    '{difference}; it is not written, because the node is not known to be pre-operational and '
    'nmt_start is false',
    do='bring the node to pre-operational, or set nmt_start')
mode_not_offered = Text(
    'mode {mode} ({number}) is none of those that 6502h offers ({offered:08X}h)',
    do='choose a mode that the drive has')
interpolation_time_left = Text(
    'a period of {period:g} s cannot be written to 60C2h exactly: it is left as it is',
    do='choose a period in whole milliseconds')
maps_found = Text('{differences}', do=_MAPS_DIFFER)
maps_wait = Text(
    '{found}; rewritten before, not again within {pause:g} s',
    do='see who else writes the maps of this drive')
maps_not_written = Text('could not be rewritten: {why}', do='see why the drive does not take it')
maps_written = Text('request map [{request:, }], response map [{response:, }]', do='nothing')
maps_unknown = Text(
    'no answer to {looks} mapping reads in a row, although cyclic requests are answered: '
    'nobody knows whether the maps are still right',
    do='see why the drive answers no reads')

# -- frames that are not as they should be --------------------------------------------------------
malformed = Text('{what}', do='see who else sends on this identifier')
_JUST_LATE = ('just after a loss it is a late answer: see what slows the computer or the adapter '
              'down')
unasked = Text(
    '{what} that nobody asked for',
    do=f'{_JUST_LATE}; else look for a second master, or a second station with the same number')
nobody_asked = Text(
    '{frame}: nobody asked for it',
    do=f'{_JUST_LATE}; else look for a second master, or a second station with the same number')
of_somebody_else = Text('{frame}: of somebody else', do='see who sends on this identifier')
not_of_this_drive = Text('{frame}: not of this drive', do='see who sends on this identifier')
unasked_pkw = Text(
    'PKW response that nobody asked for: {message}',
    do=f'{_JUST_LATE}; else look for a second master')
short_process_data = Text(
    'process data with {found} values, {needed} needed',
    do='compare cyclic_response with the settings of the inverter')
bad_cyclic_response = Text(
    'cyclic response with {what}',
    do='compare cyclic_response with the map of the drive')
other_master = Text(
    'another master sends to station {station}: {frame}',
    do='end the other master; there must be one only')
other_master_asks = Text(
    'another master sends requests to station {station}: {frame}',
    do='end the other master; there must be one only')
other_master_asks_node = Text(
    'another master sends {what} to node {node}: {frame}',
    fields='node what frame',
    do='end the other master; there must be one only')
other_master_resets = Text(
    'another master restarts {whom} (NMT {command}: {frame}): the drive loses its power and its '
    'set-up', fields='command whom frame',
    do='have the other master leave this node alone, or start it before the bridge')
other_master_nmt = Text(
    'another master sends NMT {command} to {whom}: {frame}', fields='command whom frame',
    do='have the other master leave this node alone; where it is to start the nodes, set '
       'nmt_start: false here')
heartbeats_ended = Text(
    'another master switches the heartbeats of node {node} off (1017h := 0): {frame}; a loss is '
    'seen by missing answers alone', fields='node frame',
    do='have it leave 1017h alone, or set heartbeat_timeout: 0 here')
other_master_reads = Text(
    'somebody else reads node {node} by SDO: {frame}; a node serves one client, so that requests '
    'of both can fail', fields='node frame',
    do='have it ask through the bridge (drive_can read, the parameter services)')
other_master_broadcasts = Text(
    'another master sends broadcasts, which station {station} obeys if it is set to listen '
    '(P509): {frame}',
    do='end the other master; there must be one only')

# -- reports and refusals of a drive -------------------------------------------------------------
booted = Text('boot-up: the device has started', do='nothing')
emergency = Text(
    'emergency {text}',
    do='look its code up in the manual of the drive, and remove its cause')
emergency_lasts = Text(
    'emergency {text}: remove its cause',
    do='look its code up in the manual of the drive, and remove its cause')
emergency_over = Text('emergency over: the node reports no error any more', do='nothing')
no_heartbeat_producer = Text(
    'it takes no heartbeat time (1017h): its heartbeat is not watched',
    do='set heartbeat_producer to 0 if that is as it should be')
nothing_stops = Text(
    'nothing stops this drive when the bridge dies',
    do='see bridge_heartbeat; give the drive a watchdog of its own (1016h, 6007h)')
stop_option_unknown = Text(
    '{index:04X}h = {value}: CiA 402 has no such value, and what the drive does then at {event} '
    'is not known',
    do='write one that its manual lists, or try it, with the motor uncoupled')
watch_unknown = Text(
    'whether anything stops this drive when the bridge dies is not known ({why})',
    do='look at 1016h and 6007h of the drive; try it, with the motor uncoupled')
life_guarding = Text(
    'life guarding (100Ch, 100Dh: {time} ms) is what stops this drive when the bridge dies; it '
    'begins when a master guards the drive, which the bridge does not do',
    do='try it, with the motor uncoupled; a heartbeat (1016h) needs no master that guards')
pdo_time_out = Text(
    'the time-out of its receive PDO ({what}: {time} ms) is what stops this drive when the bridge '
    'dies',
    do='try it, with the motor uncoupled; it has to be longer than period')
watch_too_short = Text(
    '{what} watches the bridge for {limit} ms, less than two intervals of its heartbeat '
    '({interval:g} s)',
    do='lengthen the time in 1016h, or shorten bridge_heartbeat')
watch_stays = Text(
    '{what} watches the bridge and is left as it is (mapping: verify): an ordered stop ends in '
    'a fault of the drive',
    do='set 1016h to 0, or let the bridge write it (mapping configure)')
heartbeat_without_content = Text(
    'heartbeat without content: this drive cannot be watched by it',
    do='set heartbeat_timeout to 0; its PDOs show whether it is there')
heartbeat_missing = Text(
    "no heartbeat although heartbeat_timeout is set: configure the device's heartbeat producer "
    '(1017h)',
    do='configure the producer, or set heartbeat_timeout 0')
read_refused = Text('read {names}: {reason}', do='correct cyclic_response or the profile')
poll_refused = Text(
    'poll of {what}: correct cyclic_response or the profile',
    do='correct cyclic_response or the profile')
write_failed = Text('write of {what}', do='see why the drive does not answer')
setpoint_not_taken = Text(
    'write of {what}: correct cyclic_request, the command or the profile',
    do='correct cyclic_request, the command or the profile')
word_not_taken = Text(
    'write of {what}: look at the device',
    do='see that the device takes control from the bus')
word_held_back = Text(
    'not sent: write of {what}',
    do='see why the drive does not take the setpoint')
neutral_not_taken = Text(
    'neutral is not taken, write of {what}',
    do=f'{STANDS_STILL}; look the reason up in its manual, then enable it again')
timeout_too_tight = Text(
    'telegram time-out {timeout:g} s ({name}, {address}) is too tight for a period of '
    '{period:g} s: set it to {least:g} s or more, or shorten the period',
    do='raise P513 of the inverter, or shorten the period of the drive')
not_monitored = Text(
    'nothing stops this inverter when the bridge dies: its telegram time-out ({name}, {address}) '
    'is {timeout:g} s, which is none', fields='name address timeout',
    do='set P513 to at least three periods')
timeout_unknown = Text(
    'telegram time-out ({address}) unknown: {reason}',
    do='see whether this inverter has the parameter')
extra_values_missing = Text(
    'values 4 and 5 do not arrive: the drive does not answer the additional frame; '
    'extra_setpoints is for SK 540E and SK 545E',
    do='set extra_setpoints false')
process_data_only = Text(
    'exists in process data only',
    do="give the profile's entry a number, if the drive has one")
process_data_not_received = Text(
    'exists in process data only, and none with it was received',
    do='map it in cyclic_response')
no_such_element = Text(
    'refused by the drive: {text}; P{parameter} has {elements:#element}',
    fields='number text parameter elements',
    do='correct the sub-index')
other_width = Text(
    'the drive answers with {answered}, the profile says {listed}: correct the profile to '
    '{correct}',
    do='correct the profile')
never_written = Text(
    'parameter {number} is never written: its number marks cyclic frames',
    do='nothing')
contradicted = Text(
    '{other} is the same parameter, and is given another value',
    do='give it one value')
one_half = Text(
    'one half of {of}: set that{writable:?}',
    'read-only: one half of {of}',
    do='set that')

# -- services -------------------------------------------------------------------------------------
rearm_would_jump = Text(
    '{setpoint} would jump: it has neutral_from, which needs rearm: neutral',
    do='leave rearm as it is')
nobody_answered = Text(
    'nobody answered: is its bridge still running?',
    do='see whether the bridge runs')
write_not_confirmed = Text(
    'not confirmed: it may have been written',
    do='read it: it may have been written')
answer_not_delivered = Text(
    'an answer of {service} could not be delivered: its caller takes none (another QoS, or DDS '
    'has not found all of it)',
    do='ask again, with the QoS of services')
requests_hold_up = Text(
    'a request that the middleware takes long to read, or an answer to a caller that it has not '
    'found yet, holds up the whole process: rclpy takes and sends them ({reason})',
    do='report it, with the version of rclpy')
requests_by_executor = Text(
    'an executor of rclpy takes the requests of all services, one after the other and with the '
    'interpreter held, and sends their answers: a stop waits for what it is at ({reason})',
    do='report it, with the version of rclpy')
commands_by_executor = Text(
    'commands and samples go by the public interface of rclpy, which costs more of the processor '
    '({reason})',
    do='report it, with the version of rclpy')
rclpy_lacks = Text(
    'this rclpy has no {names}: no bridge is possible with it',
    do='use the rclpy of Jazzy or of Kilted')
client_by_rclpy = Text(
    'bridges are asked more slowly: this rclpy is used by its public interface ({reason})',
    do='report it, with the version of rclpy')
request_hangs = Text(
    'the middleware has been reading a request of {service} for {seconds:g} s: other services go '
    'on without it',
    do='use one middleware for all (RMW_IMPLEMENTATION)')
request_hung = Text(
    'a request of {service} took the middleware {seconds:.1f} s',
    do='use one middleware for all (RMW_IMPLEMENTATION)')
request_unreadable = Text(
    'the middleware cannot read a request of {service}: {reason} (clients need the same '
    'RMW_IMPLEMENTATION)',
    do='use one middleware for all')
other_middleware = Text(
    'the bridge {bridge} runs on {theirs}, this shell on {ours} (RMW_IMPLEMENTATION): services do '
    'not work between them',
    do='set RMW_IMPLEMENTATION as the bridge has it')
profiles_not_read = Text(
    '{name} is not read by {middleware}: use {instead}',
    '{name} is not read by {middleware}',
    fields='name middleware instead',
    do='use the name that is read, with a file for that version')
protection_not_read = Text(
    '{name} is not read by {middleware}: use {instead} (drive_can security wrote {file}: without '
    'it everybody gets in)',
    '{name} is not read by {middleware} (drive_can security wrote {file}: without it everybody '
    'gets in)',
    fields='name middleware file instead',
    do='use the name that is read, or the middleware that reads it')
profiles_not_there = Text(
    '{name} names {file}, which is no file: {middleware} goes on without it',
    do='correct the path; it counts from the working directory')
no_memory_limit = Text(
    'no memory limit (memory_limit_mb): {reason}',
    do='none is needed where all use one middleware')
service_given_up = Text(
    '{service} is not served any more: {times} of its requests have stopped a thread each '
    '(clients need the same RMW_IMPLEMENTATION)',
    do='use one middleware for all, and start the bridge again')

# -- the log, and traces --------------------------------------------------------------------------
nothing_recorded = Text(
    'nothing is recorded: set trace_seconds of a bus',
    do='set trace_seconds of a bus')
log_too_fast = Text(
    '{lines:#line} of the log left out: they came faster than they could be written',
    do='see what floods the log, or what takes it so slowly')

# -- diagnostics: how a bus is --------------------------------------------------------------------
bus_up = Text('{interface} {channel}', do='nothing')
bus_not_up = Text('{state}: {outlook}', do='plug it in, or bring the interface up')
bus_disturbed = Text('{what}: {advice}', do='check cable, shield, termination and bit rate')
frames_overflowed = Text(
    '{frames} received frames lost: this machine is too slow for the traffic, see what else it '
    'does',
    do='see what else the computer does')
frames_not_sent = Text(
    '{frames:#frame} not sent: {why}',
    do='look at cable, termination and bit rate')
adapter_keeps = Text(
    '{adapter} keeps what it has received for up to {latency} ms, and the shortest period is '
    '{period} ms: {remedy}',
    latency=lambda seconds: f'{1e3 * seconds:g}',
    period=lambda seconds: f'{1e3 * seconds:g}',
    do='run that command, for good by a udev rule (docs/adapters.md), or choose longer periods')
bus_load_high = Text(
    'bus load {percent:.0f} %: raise the period of some drives or the bit rate',
    do='raise the period of some drives or the bit rate')

# -- diagnostics: how a drive is, and what to do --------------------------------------------------
online = Text('online', do='nothing')
activate_bridge = Text('bridge inactive: activate it', do=_ACTIVATE)
bridge_ended = Text('bridge ended: start it again', do='start it again')
bridge_ended_may_run = Text('bridge ended: it may still be running', do=STANDS_STILL)
stopped_for_defect = Text(
    'offline: {why}; told to stop, looked for again in a moment; please report this defect of '
    'the bridge with its log',
    do='report it')
bus_of_drive_down = Text('bus {bus} is down', do='see what diagnostics say of the bus')
bus_hangs = Text(
    'bus {bus} hangs, its drives are not told anything: its adapter does not return from a send',
    do='unplug the adapter, or end the bridge')
bus_of_drive_opening = Text(
    'bus {bus} is not open yet',
    do='wait a moment; where that stays, see what drive_can adapters says of the adapter')
never_seen = Text(
    'not seen since start: {why}; check its power, cable, station number and bit rate',
    do='check its power, cable, station number and bit rate')
not_online = Text(
    'not online since start: {why}',
    do='see what the reason says; then its power, cable and station')
offline_since = Text(
    'offline since {since}, was online before: {why}',
    do='see what the reason says; then its power, cable and station')
not_seen = Text('not seen since start: {why}', do='see what diagnostics say of the bus')
drives_missing = Text(
    '{online} of {drives:#drive} online; not seen: {missing:, }',
    do='see what is said of each of them')
silent_since = Text(
    'silent since {since}, was online before: check its power and cable ({why})',
    do='check its power and cable')
maps_to_correct = Text(
    '{why}; correct the drive or the configuration, or set mapping: configure', do=_MAPS_DIFFER)
drive_to_correct = Text(
    '{why}; correct the drive or the configuration',
    do='correct the drive or the configuration')
maps_not_kept = Text(
    '{why}; the drive does not keep the maps that are written: correct the drive or the '
    'configuration, or set mapping: assume (nothing is checked then: another content is taken for '
    'what the lists say)',
    do='correct the drive or the configuration')
maps_fixed = Text(
    '{why}; the bridge cannot write that mapping: list what the drive maps, in its order, or set '
    'mapping: assume (nothing is checked then: another content is taken for what the lists say, '
    'and nobody knows what stops the drive when the bridge dies)',
    do='list what the drive maps; drive_can probe shows it')
fault = Text(
    '{which}: remove its cause, then {reset}',
    'fault: remove its cause, then {reset}',
    fields='reset which',
    do='remove its cause, reset it, enable the drive')
still_running = Text(
    'told to stop, and still {state}',
    do=f'wait for its ramp; {STANDS_STILL}')
disabled = Text('disabled: {enable}', do='enable it, if it is to move')
disabled_and_commanded = Text(
    'disabled: {enable}; commands arrive, and change nothing',
    do='enable it, or stop what commands it')
not_armed = Text(
    'not armed: publish {wanted: and }',
    do='publish what the text names once (neutral), then the value')
slow_exchange = Text(
    'an exchange takes {mean} ms, the period is {period} ms: the drive is slow; choose a '
    'longer period or a shorter cyclic_response',
    mean=lambda mean: f'{1e3 * mean:.0f}',
    period=lambda period: f'{1e3 * period:g}',
    do='choose a longer period or a shorter cyclic_response')
one_master_only = Text(
    '{seen}: there must be one master only',
    do='end the other master: a drive obeys the last one that wrote')
frames_rejected = Text(
    '{frames:#frame} rejected, the last: {last}; check for a second station with the same number',
    do='check for a second station with the same number')
answer_late = Text(
    'answer {seconds} ms after its period: the computer, the adapter or the drive is too slow',
    seconds=_milliseconds,
    do='choose a longer period, or see what else the computer does')
answers_late = Text(
    'answer {seconds} ms after its period, and so are those of all drives of bus {bus}: what they '
    'have in common is too slow, the adapter ({adapter}) or the computer',
    seconds=_milliseconds,
    do='see what docs/adapters.md says of the adapter, and what else the computer does; or choose '
       'a longer period')
answer_kept = Text(
    'answer {seconds} ms after its period: the adapter ({adapter}) keeps what it has received for '
    'up to {latency} ms: {remedy}',
    'answer {seconds} ms after its period: the adapter ({adapter}) keeps what it has received for '
    'up to {latency} ms: choose a longer period',
    fields='seconds adapter latency remedy',
    seconds=_milliseconds,
    latency=lambda seconds: f'{1e3 * seconds:g}',
    do='run that command, for good by a udev rule (docs/adapters.md), or choose a longer period')
more_missed_would_hold = Text(
    'answered again {gap:.2g} s after its last answer: if the computer or the adapter is slow, '
    'missed_limit: {limit} would have bridged this gap; a drive that is really gone would then be '
    'noticed after {seconds:.2g} s',
    do='raise missed_limit, or see what else the computer does')
longer_period_would_hold = Text(
    'period: {period:g} would have held',
    fields='late period',
    do='raise period, or see what else the computer does')
longer_timeout_would_hold = Text(
    'its heartbeat is back, {gap:.2g} s after the last: if the computer or the adapter is slow, '
    'heartbeat_timeout: {timeout:g} would have held',
    do='raise heartbeat_timeout, or see what else the computer does')
longer_beat_would_hold = Text(
    'the drive missed the heartbeat of the bridge, which was {gap:.2g} s without one: '
    'bridge_heartbeat: {interval:g} would have held',
    do='raise bridge_heartbeat, or see what else the computer does')
beats_were_sent = Text(
    'the drive missed the heartbeat of the bridge, although that was never {gap:.2g} s without '
    'one: look at bus load and adapter, and at what the drive watches (1016h)',
    do='look at bus load and adapter; see how long 1016h of the drive waits, and for whom')

# -- a setpoint held by hand (drive_can jog) ------------------------------------------------------

jog_no_setpoint = Text(
    'nothing of it can be commanded: it has no cyclic_request',
    do='put the setpoint into cyclic_request of the drive')
jog_which = Text(
    'which setpoint? It has {names: and }: name one', do='name the setpoint')
jog_unknown = Text(
    '{name} cannot be commanded; there are: {names:, }', do='name one of those')
jog_limit = Text(
    '{name} is a limit, and moves nothing: publish it to {topic}',
    do='publish the limit as a message')
jog_position = Text(
    '{name} is a position, and where it would go from where the axis is, jog does not know: '
    'publish to {topic}',
    do='move positions by a node, or by ros2_control')
jog_timeout = Text(
    'its command_timeout is {timeout:g} s, so that nothing would stop the drive when this process '
    'dies; allowed are 0 < command_timeout <= {longest:g} s (drives.{drive}.command_timeout)',
    do='set command_timeout of the drive')
jog_not_ready = Text(
    'is {state}: {advice}', 'is {state}', do='bring it online, and enable it')
jog_fault = Text(
    'has fault {fault}: remove its cause, then: {reset}',
    'has a fault: remove its cause, then: {reset}',
    do='remove its cause, reset it, enable the drive')
jog_commanded = Text(
    'is commanded by others: {who:, }; two who command one drive move it by turns',
    do='end who else publishes commands to the drive')
jog_not_told = Text(
    'its bridge does not say what can be commanded: it is inactive, or a version without '
    'drive_can jog',
    do=f'{_ACTIVATE}; after an update, start it again')
jog_not_armed = Text(
    'was not armed within {seconds:g} s of neutral commands', do='see diagnostics of the drive')
jog_no_longer = Text('is no longer {state}', do='see diagnostics of the drive')
jog_neutral_again = Text(
    'the bridge sends {sent} instead of {wanted}: the setpoint is not armed any more',
    do='the drive has neutral; the log of the bridge says what disarmed it (late commands, a '
       'stop, a fault): remove that, and jog again')
jog_not_taken = Text(
    'the bridge did not send {wanted} within {seconds:g} s', do='see the log of the bridge')
jog_late = Text(
    'this process stood still for {seconds:.1f} s, longer than command_timeout',
    do='see what else the computer does')
jog_bridge_silent = Text(
    'nothing has come from its bridge for {seconds:g} s: if the bridge has ended, the drive may '
    'still be running',
    do=f'{STANDS_STILL}; see whether the bridge still runs')
jog_unanswered = Text(
    'no exchange that carried {value} was answered', do='see diagnostics of the drive')
jog_neutral_unseen = Text(
    'neutral was published, and no answer shows that the drive has it: it may still be running',
    do=f'{STANDS_STILL}; see diagnostics of the drive')
jog_interrupted = Text('interrupted', do='nothing: the drive got neutral')
jog_done = Text('{value} was sent and answered, then neutral', do='nothing')

# -- the bridge, its topics and its services: texts of log and answers ----------------------------
possible_are = Text('possible are {possible:, }', do='ask for one of these')
being_stopped = Text('the bridge is being stopped', do='start the bridge again when it has ended')
transition_failed = Text(
    '{name} failed: {kind}: {text}',
    do='report it, with the log of the bridge')
nameless_parameter = Text('a parameter has no name', do='give the parameter a name')
no_such_type = Text(
    'type {number} does not exist',
    do='send one of the types of rcl_interfaces/msg/ParameterType')
command_names_lines = Text('{command} names the lines', do='run that command')
active = Text('active: {drives:#drive} on {buses}', do='nothing')
shut_down = Text(
    'shut down: nothing is sent any more; end this process, and start it again to go on',
    do='end the process, and start it again where drives are to run')
stop_frames_not_sent = Text(
    'bus {bus}: the stop frames could not all be sent: {reason}', do=STANDS_STILL)
commands_discarded = Text(
    '{count:#command} thrown away: {why}',
    do='see what held the bridge up; publish again')
asked_on_host = Text(
    '{action}, asked by {whom}', '{action}, asked on this host',
    do='nothing; it shows who has asked this of the drive by drive_can, past ROS')
asked_through_ros = Text(
    '{action}, asked through ROS',
    do='nothing; it shows that a node, a command or the panel has called this service of the '
       'drive')
armed_by = Text(
    '{name} armed, commanded by {who:, }', '{name} armed',
    do='nothing; commands of these nodes reach the drive from now on')
command_while_disabled = Text(
    'command {name} has no effect: disabled, {enable}',
    do='enable it, or stop what commands it')
command_while_not_armed = Text(
    'command {name} has no effect: not armed, send {neutral} once first',
    do='publish neutral once, then the value')
joint_command_short = Text(
    'joint_command has fewer {quantity} values than names',
    do='have its publisher give as many values as names')
call_enable = Text(
    'call ~/enable{whom} ({command})',
    do='run that command, and mind that it may then be commanded')
call_reset = Text(
    'call ~/reset_fault{whom} ({reset}) and ~/enable ({enable})',
    do='run these commands, when the cause is gone')
reset_at_drive = Text(
    'reset it at the drive',
    do='see in its manual how: a key, an input, power off and on')
attendance_failed = Text('attendance: {kind}: {text}', do='report it')
any_command_to = Text('a command to {topic}/command/{name}', do='publish it')
neutral_to = Text('{neutral} to {topic}/command/{name}', do='publish it')
failed_and_looked_for = Text(
    'offline: {reason}; told to stop, and then looked for again',
    do='report it, with the log of the bridge')
command_timed_out = Text(
    'no command for {timeout:g} s: {names:, } neutral until armed again',
    do='publish at least once in command_timeout; arm it again')
no_cyclic_frame = Text('mapping differs, no cyclic frame is sent: {how}', do=_MAPS_DIFFER)
maps_rewritten = Text('maps of the drive rewritten: {how}', do='nothing')
frame_rejected = Text('frame rejected: {what}', do='see who else sends on its identifiers')
stopped_state_differs = Text(
    'told to stop, and answers, but its last status word does not say so: {state}',
    do='look whether it stands; its status word may lag, or the drive still runs down')
cannot_publish = Text(
    'cannot publish: {reason}',
    do='report it, with the version of the middleware')
identity_unread = Text(
    'identity: {name} ({address}): {reason}',
    do='correct identity or the parameter in the profile')
too_many_names = Text(
    '{names} names, at most {most} are allowed',
    do='publish fewer joints in one message')
ends_too_soon = Text(
    '{whole} bytes, which end too soon',
    do='see who publishes it, and with which middleware')
too_many_bytes = Text('{whole} bytes, at most {most} are looked at', do='publish shorter messages')
command_unreadable = Text(
    'command on {topic} cannot be read: {reason}',
    do='have its publisher use the type of the topic')
values_for_names = Text(
    '{count} {quantity} values for {names} names; allowed are as many as names, with NaN for '
    'joints that are to be left alone, or none',
    do='have its publisher give as many values as names')
joint_twice = Text(
    '{name} stands twice, allowed is once',
    do='have its publisher name each joint once')
foreign_joint = Text(
    'joint_commands name {name}, which is no joint of this bridge: ignored',
    do='nothing, where another bridge has that joint; else correct the name')
local_name_taken = Text(
    'commands on this host take the way through ROS: another process has the name by which this '
    'bridge would listen to them',
    do='nothing; see what other process of this host has the name where it should not')
makes_no_sense = Text('this makes no sense', do='use a command of the same version as the bridge')
too_many_patterns = Text('too many patterns', do='name the drives, or use shorter patterns')
no_such_node = Text('no such node', do='see ros2 node list for the names of drives')
unknown_order = Text(
    'nobody knows what that is',
    do='use a command of the same version as the bridge')
lines_left_out = Text(
    '{lines} more lines left out: too many different ones at once',
    do='see what floods the log: the lines before')
names_in_call = Text(
    '{names} names in one call, at most {most} are allowed',
    do='ask with fewer names in one call')
name_too_long = Text('a name longer than {most} characters', do='use the name of a parameter')
more_names_failed = Text(
    '{count} more names of the same call failed',
    do='see why the others of the call failed')
internal_error_in_answer = Text(
    'internal error in an answer: {kind}: {text}',
    do='report it, with the log of the bridge')
internal_error_in_callback = Text(
    'internal error in a callback: {kind}: {text}',
    do='report it, with the log of the bridge')
clock_impossible = Text(
    'the {which} clock says {seconds} s since 1970, stamps hold 0 to {most}: they are 0 until it '
    'is set right',
    do='set the clock')
exchange_late = Text('the exchange was {seconds:.2f} s late', do='see what else the computer does')
stood_still_for = Text(
    'the bridge stood still for {seconds:.2f} s',
    do='see what else the computer does')
bus_blocks = Text('the bus blocks', do='look at adapter, cable and termination')
ros_does_not_start = Text(
    'ROS does not start: {why}',
    do='correct what it says of ROS_DOMAIN_ID, RMW_IMPLEMENTATION or the installation')
silent_and_holds = Text(
    '{name}: {how}, and holds its drives (the computer may be busy)',
    do='see whether that process hangs; end it and start the bridge again')
several_not_all_answer = Text(
    'several bridges are running: {names:, }, and not every one answers: {silent:, }',
    do='choose one with --namespace; see why the others do not answer')
node_unanswering = Text(
    '{node} does not answer for {timeout:g} s (the computer may be busy)',
    do='see what else the computer does, and whether the bridge hangs')
no_such_service = Text(
    '{node} does not offer {service}',
    do='see whether it is a drive of a bridge, and of this version')
way_closed = Text('the way to the bridge is closed already', do='open it again')
node_gone = Text('{node} has gone', do='see why the bridge has ended')
node_does_not_answer = Text('{node} does not answer: {reason}', do='see whether the bridge hangs')
transition_impossible = Text(
    'transition {transition} is not possible in state {state} ({why})',
    do='ask for one of the transitions that are possible (ros2 lifecycle list)')
command_refused = Text(
    'command {name} refused: {reason}',
    do='publish a value inside of the range of the setpoint')
publisher_incompatible = Text(
    'a publisher of {topic} offers incompatible quality of service ({policy}): nothing is '
    'received from it',
    do='have its publisher use the QoS of the topic (docs/ros_interface.md)')
command_late = Text(
    'command on {topic} thrown away: it came {seconds:.2f} s later than others have',
    do='see whether a clock was set (of this computer, or of its publisher), and what slows the '
       'network, or the publisher, down')
joint_states_unpublished = Text(
    'joint_states cannot be published: {reason}',
    do='report it, with the version of the middleware')
joint_commands_refused = Text(
    'joint_commands refused: {why}',
    do='correct what publishes joint_commands')
values_without_names = Text(
    '{count} {quantity} values and no names',
    do='have its publisher name the joints')

# -- commands, views and clients: what they refuse, and what failed -------------------------------
namespace_or_file = Text(
    'namespace is of a running bridge, params_file goes without one',
    do='leave one of them out')
nmt_start_alone = Text(
    'nmt_start goes with params_file only: a bridge starts its nodes itself',
    do='give params_file, or leave nmt_start out')
file_unreadable = Text('{file}: {reason}', do='give a readable file')
no_value = Text('no value; the log of the bridge says why', do='see the log of the bridge')
node_not_operational = Text(
    'a CANopen node that is not operational answers no PKW, --nmt-start starts it',
    do='give --nmt-start, or have its NMT master start it')
leave_file_away = Text('leave --params-file away to go through it', do='leave --params-file away')
bridge_sends_word = Text(
    'control word: only a running bridge sends it',
    do='start the bridge; then drive_can enable, disable, stop, or ~/enable')
bridge_sends_setpoint = Text(
    'setpoint {name}: only a running bridge sends it',
    do='start the bridge; then drive_can jog, or publish to ~/command/NAME')
bus_closed = Text('bus {bus}: is closed already', do='open it again')
bus_because = Text('bus {bus}: {reason}', do='look at the adapter; see what the reason says')
telegrams_supervised = Text(
    '{drive}: {address} is not 0: the drive supervises telegrams once it has got one, and faults '
    'when they end',
    do='set it to 0 while you work without the bridge, or reset the fault afterwards')
bus_not_opening = Text(
    'bus {bus}: it does not open',
    do='see the lines before it; drive_can adapters shows which adapters there are')
other_master_talks = Text(
    'bus {bus}: another master talks to drive {drive} ({frame}); end it first',
    do='end the other master; there must be one only')
no_drive_there = Text(
    'no drive {drive}{near}; there are: {there}',
    'no drive {drive}; there are: {there}',
    fields='drive there near',
    do='use one of the names')
no_bridge_or_file = Text(
    '{why}, or name its file with --params-file to talk to the drives directly',
    do='start a bridge, or give --params-file')
several_bridges = Text(
    'several bridges are running: {names:, }; choose one with --namespace',
    do='give --namespace NS: what stands before the last / of its name')
bridges_of_one_name = Text(
    '{count} bridges are called {name}: start each in a namespace of its own', do=APART)
drive_of_two_bridges = Text(
    '{one} and {other} have a drive {drive} each: start each in a namespace of its own',
    do=APART)
bridge_ended_here = Text('bridge ended', do='nothing: it was ended from here')
bridge_silent_may_run = Text(
    'may still be running: its bridge is silent',
    do=f'{STANDS_STILL}; see whether the bridge runs')
no_sample = Text(
    'offline: no sample for {seconds:.0f} s: is its bridge {bridge} still running?',
    do='see whether that bridge runs')
bridge_silent = Text('its bridge {bridge} is silent', do='see whether that bridge runs')
drive_of_silent_bridge = Text(
    'its bridge is silent since {since}',
    do=f'{STANDS_STILL}; see whether its bridge runs')
stopped_answering = Text('offline: it stopped answering', do='wait for what diagnostics say of it')
bridge_silent_since = Text(
    'bridge {name}silent since {since}: its drives may still be running; a stop may not reach '
    'them',
    do=STANDS_STILL)
no_such_value = Text('{word} is no value: write {kind}{example}', do='write a value of that kind')
moves_the_drive = Text(
    'moves the drive: not written here',
    do='publish the setpoint, or use drive_can jog')
protected = Text(
    'protected by its profile: not written here',
    do='use drive_can write or restore --include-protected, knowing what it does')
no_bridge_tells = Text(
    '{names:, }: in the graph, but no bridge tells of it: may be running',
    do=f'{STANDS_STILL}; see which process has it')
setpoint_of_bridge = Text('sent cyclically: a setpoint', do='publish it, or use drive_can jog')
word_of_bridge = Text('control word: use ~/enable', do='use drive_can enable, disable, stop')
map_of_bridge = Text(
    'a map: not written while the bridge runs',
    do='use mapping: configure, which writes the maps, or deactivate the bridge')

# -- a restore: why a setting is not as in the file -----------------------------------------------
drive_has_not = Text('the drive has no such parameter', do='nothing; its firmware is another one')
other_bits_lost = Text(
    'cannot be read, so its other bits cannot be kept',
    do='see why the drive does not answer, then restore again')
not_set_back = Text('not set back', do='set the mode back by hand, then restore again')
not_written = Text('not written', do='restore again when the reason of the others is gone')
interrupted = Text('interrupted', do='restore again: only what differs is written')
enabled_meanwhile = Text('was enabled meanwhile', do='disable the drive, then restore again')
answers_no_more = Text(
    'the drive answers no more',
    do='see what it does after that write; power it up again, then restore again')
acknowledged_not_taken = Text(
    'acknowledged, and not taken',
    do='see in the manual in which state or mode the drive takes it (restore: of a profile)')

#: all sentences there are, by their codes
CODES = catalogue(globals())
