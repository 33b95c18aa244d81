# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What is said to people of drives, requests and stops: every sentence, by its code.

What has something to tell calls a function of this module; its name is the *code*, its
arguments are the *fields*, and what it returns is the sentence. A :class:`Sentence` is text
wherever text is wanted, and tells programs and tests what it says without being read:

.. code-block:: python

    reason = sentences.no_answer(timeout=0.1, attempts=3)
    reason == 'no answer in 0.1 s, 3 attempts'
    reason.code == 'no_answer' and reason.fields['attempts'] == 3

A sentence that gives the reason of another one has it among its fields, code and all.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import wraps
import inspect
from typing import Any, ParamSpec

from drive_can_bridge.core.text import counted

P = ParamSpec('P')


class Sentence(str):
    """
    A text for people that programs need not read.

    :ivar code: what it says, as a stable word.
    :ivar fields: of what, by name.
    """

    __slots__ = ('code', 'fields')

    code: str
    fields: Mapping[str, Any]

    def __new__(cls, text: str = '', code: str = '',
                fields: Mapping[str, Any] | None = None) -> 'Sentence':
        said = super().__new__(cls, text)
        said.code, said.fields = code, fields or {}
        return said


#: where there is nothing to be said
NOTHING = Sentence()

#: all sentences there are, by their codes
CODES: dict[str, Callable[..., Sentence]] = {}


def sentence(make: Callable[P, str]) -> Callable[P, Sentence]:
    """Make a function that returns a text one that returns a :class:`Sentence`."""
    names = tuple(inspect.signature(make).parameters)

    @wraps(make)
    def said(*args: P.args, **kwargs: P.kwargs) -> Sentence:
        return Sentence(make(*args, **kwargs), make.__name__, {**dict(zip(names, args)), **kwargs})

    CODES[make.__name__] = said
    return said


@sentence
def uncoded(text: str) -> str:
    return text


def together(said: Iterable[Sentence]) -> Sentence:
    """Say several things in one line; its code is that of the first, all are in its fields."""
    parts = [part for part in said if part]
    if len(parts) < 2:
        return parts[0] if parts else NOTHING
    return Sentence('; '.join(parts), parts[0].code, {'parts': parts})


# -- requests: why a parameter was not read or written --------------------------------------------


@sentence
def no_answer(timeout: float, attempts: int) -> str:
    return f'no answer in {timeout:g} s, {counted(attempts, "attempt")}'


@sentence
def no_answer_briefly() -> str:
    return 'no answer'


@sentence
def no_answer_offline() -> str:
    return 'no answer; drive offline'


@sentence
def no_answer_because(reason: str) -> str:
    return f'no answer: {reason}'


@sentence
def drive_offline() -> str:
    return 'drive offline'


@sentence
def drive_offline_because(reason: str) -> str:
    return f'drive offline: {reason}'


@sentence
def bus_down() -> str:
    return 'bus down'


@sentence
def bridge_inactive() -> str:
    return 'bridge inactive'


@sentence
def not_sent() -> str:
    return 'not sent: the bus takes no frames'


@sentence
def no_result() -> str:
    return 'no result'


@sentence
def busy() -> str:
    return 'busy'


@sentence
def sent_unacknowledged() -> str:
    return 'sent; this protocol does not acknowledge writes'


@sentence
def refused_by_drive(number: int, text: str) -> str:
    return f'refused by the drive: {text}'


@sentence
def read_back_differs(found: str, wanted: str) -> str:
    return f'read back {found} instead of {wanted}'


@sentence
def other_length(length: int, listed: str) -> str:
    return f'the drive answers with {counted(length, "byte")}, the profile says {listed}'


@sentence
def too_long(length: int) -> str:
    return f'{counted(length, "byte")}: only objects of 1 to 4 bytes are numbers'


@sentence
def no_object() -> str:
    return 'has no index in the profile, so no SDO reaches it'


@sentence
def width_unknown() -> str:
    return ('how many bits it has, nobody knows: it cannot be read, and is not in the profile; '
            'add it there')


@sentence
def not_in_one_frame(fits: str) -> str:
    return f'cannot be written in one frame, nothing was written: {fits}'


@sentence
def nothing_written(why: str) -> str:
    return f'{why}; nothing was written'


# -- requests: why a value or a name is refused before any frame ----------------------------------


@sentence
def read_only() -> str:
    return 'read-only'


@sentence
def out_of_range(value: str, allowed: str) -> str:
    return f'{value} is out of range: {allowed}'


@sentence
def too_many_bits(bits: int, allowed: str) -> str:
    return f'a number of {bits} bits is out of range: {allowed}'


@sentence
def wrong_type(found: str, expected: str) -> str:
    return f'wrong type: {found}, expected {expected}'


@sentence
def not_a_bool(value: str) -> str:
    return f'{value} is not a bool'


@sentence
def not_a_number(value: str) -> str:
    return f'{value} is a bool, not a number'


@sentence
def not_finite(value: str) -> str:
    return f'{value} is not a finite number'


@sentence
def not_an_integer(value: str) -> str:
    return f'{value} is not an integer'


@sentence
def not_carried(value: str, type_name: str, allowed: str) -> str:
    return f'{value} is not representable: {type_name} carries {allowed}'


@sentence
def none_in_range(value: str, type_name: str, allowed: str) -> str:
    return f'{value} is not representable: {type_name} has no value in {allowed}'


@sentence
def not_in_bits(value: int, bits: int, low: int, high: int) -> str:
    return f'{value} is not representable in {bits} bits: {low} to {high}'


@sentence
def raw_refused(value: int, name: str, reason: str) -> str:
    return f'raw {value} of {name}: {reason}'


@sentence
def unknown_parameter(name: str, nearest: str | None = None) -> str:
    return f'unknown parameter {name}' + (f', did you mean {nearest}?' if nearest else '')


@sentence
def use_enable() -> str:
    return 'use ~/enable'


@sentence
def sent_cyclically(name: str) -> str:
    return f'sent cyclically: publish ~/command/{name}'


@sentence
def sent_by_group(name: str, leader: str) -> str:
    return f'sent cyclically by the broadcast group: publish {leader}/command/{name}'


@sentence
def mapping_parameter() -> str:
    return 'mapping parameter: not written while the bridge is active'


@sentence
def joint_quantity_ignored(quantity: str) -> str:
    return (f'joint_command has a {quantity}, which is ignored: joint.{quantity}_command is not '
            f'configured')


@sentence
def joint_not_named(joint: str) -> str:
    return f'joint_command without an entry named {joint}'


# -- control: what became of enable, disable, quick stop and fault reset --------------------------


@sentence
def no_control_section() -> str:
    return 'the profile has no control section'


@sentence
def nothing_commanded() -> str:
    return 'nothing is commanded'


@sentence
def neutral_without_control() -> str:
    return 'neutral; it has no control word'


@sentence
def neutral_unanswered(timeout: float) -> str:
    return f'told to be neutral, but no answer to that in {timeout:g} s'


@sentence
def disabled_instead(outcome: str) -> str:
    return f'{outcome}; told to disable, the profile has no quick_stop word'


@sentence
def no_reset_word() -> str:
    return 'no fault reset: the profile has no reset_fault word'


@sentence
def reset_first(fault: str = '') -> str:
    return (f'fault {fault}: remove its cause, then reset it first' if fault else
            'fault: reset it first')


@sentence
def fault_named(number: str, name: str) -> str:
    return f'fault {number}{" " * bool(name)}{name}: remove its cause, then reset it'


@sentence
def number_unread(reason: str) -> str:
    return f'(number not read: {reason})'


@sentence
def fault_unread(reason: str) -> str:
    return f'fault {number_unread(reason)}'


@sentence
def replaced(action: str) -> str:
    return f'replaced by {action}'


@sentence
def stop_under_way(stop: str, action: str) -> str:
    return f'{stop} under way: try {action} again when it has ended'


@sentence
def members_offline(names: Collection[str]) -> str:
    return f'{", ".join(names)} offline'


@sentence
def members_may_run(names: Collection[str]) -> str:
    return f'{", ".join(names)} offline: it may still be running'


@sentence
def group_is_led(leader: str, service: str) -> str:
    return f'{leader} leads the broadcast group: call ~/{service} of {leader}'


@sentence
def position_not_told(name: str, measured: str, known: bool) -> str:
    return f'{name} does not have the value of {measured} yet' + (
        '' if known else ', which is not known or which it cannot carry')


@sentence
def would_jump(why: str) -> str:
    return f'it would jump: {why}'


@sentence
def status_word(raw: int) -> str:
    return f'status word {raw:04X}h'


@sentence
def status_words(raws: Mapping[str, int | None]) -> str:
    words = (f'{name} {"unknown" if raw is None else f"{raw:04X}h"}' for name, raw in raws.items())
    return f'status words: {", ".join(words)}'


@sentence
def no_status_word() -> str:
    return 'no status word'


@sentence
def state_reached(state: str) -> str:
    return state


@sentence
def state_not_reported(action: str) -> str:
    return f'{action} sent; the drive does not report its state'


@sentence
def reset_not_reported() -> str:
    return 'reset_fault sent; the drive does not report faults'


@sentence
def fault_present(timeout: float, status: str, fault: str = '') -> str:
    still = f'still present after {timeout:g} s ({status})'
    return (f'fault {fault}: remove its cause, then reset it again; {still}' if fault else
            f'fault {still}')


@sentence
def stuck(timeout: float, state: str, status: str, remarks: Sequence[Sentence] = ()) -> str:
    return '; '.join((f'no confirmation in {timeout:g} s: stuck in state {state} ({status})',
                      *remarks))


@sentence
def voltage_disabled() -> str:
    return 'voltage is disabled: look at the digital inputs with that function'


@sentence
def quick_stop_active() -> str:
    return 'a quick stop is active: look at the digital inputs with that function'


@sentence
def bus_not_in_control() -> str:
    return 'the bus is not in control: look at P509 and P510'


@sentence
def word_not_acknowledged(word: int) -> str:
    return f'control word {word:04X}h was not acknowledged'


@sentence
def word_not_sent(word: int) -> str:
    return f'control word {word:04X}h could not be sent'


@sentence
def no_status_since(word: int) -> str:
    return f'no status word since control word {word:04X}h'


@sentence
def local_control() -> str:
    return 'the drive is not under remote control: look at what gives it its commands'


@sentence
def quick_stop_holds(state: str) -> str:
    return f'{state}, holds'


@sentence
def error_code(code: int) -> str:
    return f'error code (603Fh) {code:04X}h'


@sentence
def target_not_acknowledged(timeout: float, expected: int) -> str:
    return (f'it has not acknowledged its target: bit 12 of the status word is not {expected} '
            f'after {timeout:g} s; the next target waits for it')


@sentence
def bridge_missed() -> str:
    return 'the drive missed the bridge: reset the fault'


@sentence
def mode_differs(mode: str, number: int, shown: int | None) -> str:
    return (f'6061h shows {"nothing" if shown is None else f"mode {shown}"} yet instead of '
            f'{number} ({mode})')


@sentence
def mode_not_shown() -> str:
    return 'it has no 6061h: nobody knows whether it is in its mode'


@sentence
def word_not_followed(word: int) -> str:
    return f'it does not follow control word {word:04X}h'


@sentence
def word_stays() -> str:
    return 'the word stays'


@sentence
def still_braking() -> str:
    return 'still braking: the word stays'


@sentence
def word_sent_last(word: int) -> str:
    return f'told {word:04X}h'


@sentence
def no_homing() -> str:
    return 'this drive has no homing'


@sentence
def homing() -> str:
    return 'homing'


@sentence
def homing_under_way() -> str:
    return 'homing is under way'


@sentence
def homing_needs_enabled() -> str:
    return 'enable it first: only an enabled drive looks for its reference'


@sentence
def homing_needs_disarmed() -> str:
    return 'it is armed: stop commanding it, until command_timeout has passed'


@sentence
def homing_timed_out(timeout: float, step: str) -> str:
    return f'homing not ended in {timeout:g} s: stopped {step}'


@sentence
def homing_stopped(step: str) -> str:
    return f'homing stopped {step}'


@sentence
def fault_while_homing(step: str, fault: str = '') -> str:
    return f'{reset_first(fault)}; {homing_stopped(step)}'


@sentence
def homing_failed() -> str:
    return 'the drive reports a homing error (bit 13)'


@sentence
def homing_moves_on() -> str:
    return 'the axis does not stand'


@sentence
def mode_refused(mode: int) -> str:
    return f'the drive does not change to mode {mode}'


@sentence
def homed() -> str:
    return 'homed'


@sentence
def now_disable() -> str:
    return 'now disable'


@sentence
def word_refused(word: int, reason: str) -> str:
    return f'control word {word:04X}h {reason}'


@sentence
def fault_came(status: str, ran: bool) -> str:
    return f'fault ({status})' + ('; only ~/enable starts the drive again' if ran else '')


@sentence
def fault_gone(status: str) -> str:
    return f'fault gone ({status})'


@sentence
def fault_while_enabling(status: str, fault: str = '') -> str:
    return (f'fault {fault}: remove its cause, then reset it first; it came while enabling '
            f'({status})' if fault else f'fault while enabling ({status}): reset it first')


@sentence
def dropped_out(status: str) -> str:
    return f'no longer enabled, by itself ({status})'


@sentence
def dropped_out_for_good(status: str) -> str:
    return f'no longer enabled, by itself ({status}); only ~/enable starts the drive again'


@sentence
def enable_withdrawn(reason: str, whom: str) -> str:
    return f'enable withdrawn: {reason}; only ~/enable starts {whom} again'


@sentence
def status_missing(answers: int) -> str:
    return f'{answers} answers without a status word'


@sentence
def disregards(state: str, status: str, action: str, word: int) -> str:
    return (f'still {state} ({status}) although its control word is {action} ({word:04X}h): stop '
            f'it by other means, or set a control_timeout longer than its ramp')


# -- defects of this program ----------------------------------------------------------------------


@sentence
def internal_error(kind: str, text: str) -> str:
    return f'internal error: {kind}: {text}'


@sentence
def partner_failed(name: str, why: str) -> str:
    return f'{name}: {why}'


# -- stops ----------------------------------------------------------------------------------------


@sentence
def may_still_be_running(why: str) -> str:
    return f'{why}: it may still be running'


@sentence
def no_answer_to_stop(seconds: float) -> str:
    return f'no answer in {seconds:g} s'


@sentence
def nobody_takes(service: str) -> str:
    return f'nobody offers its ~/{service}'


@sentence
def stop_not_answered() -> str:
    return 'told to stop, but it does not answer'


@sentence
def stop_failed(what: Sequence[str]) -> str:
    return f'told to stop, but {"; ".join(what)}'


@sentence
def still_in_state(state: str) -> str:
    return f'it is still in state {state}'


@sentence
def stop_not_possible() -> str:
    return 'could not be told to stop'


@sentence
def bus_lost_before_stop() -> str:
    return 'the bus was lost before it could be told to stop'


@sentence
def ends_before_stop() -> str:
    return 'the bridge ends before the drive has confirmed its stop'


@sentence
def position_unknown() -> str:
    return 'where its axis is, nobody knows, so that it is told nothing'


@sentence
def stopped_again() -> str:
    return 'told to stop once more, which it has confirmed'


@sentence
def no_answer_for_map(number: int) -> str:
    return f'no answer for map parameter {number}'


@sentence
def write_unanswered(what: str) -> str:
    return f'{what}: no answer'


@sentence
def write_not_taken(what: str) -> str:
    return f'{what} not taken by the bus'


@sentence
def write_not_acknowledged(what: str, attempts: int) -> str:
    return f'{what} not acknowledged in {attempts} attempts'


@sentence
def write_read_back(what: str, found: int, wanted: int) -> str:
    return f'{what}: read back {found} instead of {wanted}'


@sentence
def write_refused(what: str, reason: str) -> str:
    return f'{what} {reason}'


# -- why a drive is offline, and what to look at --------------------------------------------------


@sentence
def not_activated() -> str:
    return 'not activated'


@sentence
def deactivated() -> str:
    return 'deactivated'


@sentence
def looked_for() -> str:
    return 'being looked for'


@sentence
def set_up_unanswered() -> str:
    return 'no answer to SDO: drive silent, wrong station or bit rate'


@sentence
def found_enabled(state: str) -> str:
    return f'found in state {state}: it is disabled before anything else'


@sentence
def found_braking(state: str) -> str:
    return f'found in state {state}: it is not touched before that has ended'


@sentence
def found_running(state: str) -> str:
    return f'told to stop by SDO, and still in state {state}: it is not cycled'


@sentence
def bus_is_down(bus: str, reason: str) -> str:
    return f'bus {bus} is down'     # why is told once, at the bus


@sentence
def reconnected() -> str:
    return 'the drive is being reconnected'


@sentence
def bridge_stood_still() -> str:
    return 'the bridge stood still'


@sentence
def silent_for_cycles(what: str, cycles: int) -> str:
    return f'{what} for {cycles} cycles'


@sentence
def no_round(periods: int) -> str:
    return f'no complete round of reads for {periods} periods'


@sentence
def device_restarted() -> str:
    return 'the device restarted'


@sentence
def no_heartbeat(timeout: float) -> str:
    return f'no heartbeat for {timeout:g} s'


@sentence
def node_state(state: str) -> str:
    return f'node is {state}'


@sentence
def silent(what: str, look_at: str) -> str:
    return f'{what}: {look_at}'


@sentence
def lost_because(why: str, gap: str) -> str:
    return f'{why}: {gap}'


@sentence
def maps_unread() -> str:
    return ('no answer to mapping read: drive silent, wrong station, bit rate or identifier '
            'mode')


@sentence
def cycles_unanswered() -> str:
    return 'no cyclic response: drive silent or response identifier taken'


@sentence
def reads_unanswered() -> str:
    return 'no answer to reads: drive silent, wrong station, bit rate or identifier mode'


@sentence
def rounds_unanswered() -> str:
    return ('no complete round of reads: drive silent, not operational, or other COB-IDs than '
            'configured')


@sentence
def one_read_unanswered(names: str) -> str:
    return (f'no answer to the read of {names}, though others are answered: does this drive '
            f'have it')


@sentence
def restarted_waiting() -> str:
    return 'the device restarted: waiting for it to answer'


# -- maps -----------------------------------------------------------------------------------------


@sentence
def mapping_differs(how: str) -> str:
    return f'mapping differs: {how}'


@sentence
def object_refused(what: str, why: str) -> str:
    return f'{what} refused by the drive: {why}'


@sentence
def object_differs(what: str, found: str, wanted: str) -> str:
    return f'{what} is {found} instead of {wanted}'


@sentence
def no_such_pdo(kind: str, number: int) -> str:
    return f'the drive has no {kind}{number}'


@sentence
def not_pre_operational(difference: str) -> str:
    return (f'{difference}; it is not written, because the node is not known to be '
            f'pre-operational and nmt_start is false')


@sentence
def mode_not_offered(mode: str, number: int, offered: int) -> str:
    return f'mode {mode} ({number}) is none of those that 6502h offers ({offered:08X}h)'


@sentence
def interpolation_time_left(period: float) -> str:
    return f'a period of {period:g} s cannot be written to 60C2h exactly: it is left as it is'


@sentence
def maps_found(differences: str) -> str:
    return differences


@sentence
def maps_wait(found: str, pause: float) -> str:
    return f'{found}; rewritten before, not again within {pause:g} s'


@sentence
def maps_not_written(why: str) -> str:
    return f'could not be rewritten: {why}'


@sentence
def maps_written(request: Sequence[int], response: Sequence[int]) -> str:
    return f'request map {list(request)}, response map {list(response)}'


@sentence
def maps_unknown(looks: int) -> str:
    return (f'no answer to {looks} mapping reads in a row, although cyclic requests are answered: '
            f'nobody knows whether the maps are still right')


# -- frames that are not as they should be --------------------------------------------------------


@sentence
def malformed(what: str) -> str:
    return what


@sentence
def unasked(what: str) -> str:
    return f'{what} that nobody asked for'


@sentence
def nobody_asked(frame: str) -> str:
    return f'{frame}: nobody asked for it'


@sentence
def of_somebody_else(frame: str) -> str:
    return f'{frame}: of somebody else'


@sentence
def not_of_this_drive(frame: str) -> str:
    return f'{frame}: not of this drive'


@sentence
def unasked_pkw(message: str) -> str:
    return f'PKW response that nobody asked for: {message}'


@sentence
def short_process_data(found: int, needed: int) -> str:
    return f'process data with {found} values, {needed} needed'


@sentence
def bad_cyclic_response(what: str) -> str:
    return f'cyclic response with {what}'


@sentence
def other_master(station: int, frame: str) -> str:
    return f'another master sends to station {station}: {frame}'


@sentence
def other_master_asks(station: int, frame: str) -> str:
    return f'another master sends requests to station {station}: {frame}'


@sentence
def other_master_asks_node(node: int, what: str, frame: str) -> str:
    return f'another master sends {what} to node {node}: {frame}'


@sentence
def other_master_broadcasts(station: int, frame: str) -> str:
    return (f'another master sends broadcasts, which station {station} obeys if it is set to '
            f'listen (P509): {frame}')


# -- what a drive says of itself, or does not take ------------------------------------------------


@sentence
def booted() -> str:
    return 'boot-up: the device has started'


@sentence
def emergency(text: str) -> str:
    return f'emergency {text}'


@sentence
def emergency_lasts(text: str) -> str:
    return f'emergency {text}: remove its cause'


@sentence
def emergency_over() -> str:
    return 'emergency over: the node reports no error any more'


@sentence
def no_heartbeat_producer() -> str:
    return 'it takes no heartbeat time (1017h): its heartbeat is not watched'


@sentence
def nothing_stops() -> str:
    return 'nothing stops this drive when the bridge dies'


@sentence
def watch_unknown() -> str:
    return 'whether anything stops this drive when the bridge dies is not known (mapping: assume)'


@sentence
def watch_too_short(what: str, limit: int, interval: float) -> str:
    return (f'{what} watches the bridge for {limit} ms, less than two intervals of its heartbeat '
            f'({interval:g} s)')


@sentence
def watch_stays(what: str) -> str:
    return (f'{what} watches the bridge and is left as it is (mapping: verify): an ordered stop '
            f'ends in a fault of the drive')


@sentence
def heartbeat_missing() -> str:
    return ("no heartbeat although heartbeat_timeout is set: configure the device's heartbeat "
            'producer (1017h)')


@sentence
def read_refused(names: str, reason: str) -> str:
    return f'read {names}: {reason}'


@sentence
def poll_refused(what: str) -> str:
    return f'poll of {what}: correct cyclic_response or the profile'


@sentence
def write_failed(what: str) -> str:
    return f'write of {what}'


@sentence
def setpoint_not_taken(what: str) -> str:
    return f'write of {what}: correct cyclic_request, the command or the profile'


@sentence
def word_not_taken(what: str) -> str:
    return f'write of {what}: look at the device'


@sentence
def word_held_back(what: str) -> str:
    return f'not sent: write of {what}'


@sentence
def neutral_not_taken(what: str) -> str:
    return f'neutral is not taken, write of {what}'


@sentence
def timeout_too_tight(timeout: float, name: str, address: str, period: float,
                      least: float) -> str:
    return (f'telegram time-out {timeout:g} s ({name}, {address}) is too tight for a period of '
            f'{period:g} s: set it to {least:g} s or more, or shorten the period')


@sentence
def timeout_unknown(address: str, reason: str) -> str:
    return f'telegram time-out ({address}) unknown: {reason}'


@sentence
def extra_values_missing() -> str:
    return ('values 4 and 5 do not arrive: the drive does not answer the additional frame; '
            'extra_setpoints is for SK 540E and SK 545E')


@sentence
def process_data_only() -> str:
    return 'exists in process data only'


@sentence
def process_data_not_received() -> str:
    return 'exists in process data only, and none with it was received'


@sentence
def no_such_element(number: int, text: str, parameter: int, elements: int) -> str:
    return f'refused by the drive: {text}; P{parameter} has {counted(elements, "element")}'


@sentence
def other_width(answered: str, listed: str, correct: str) -> str:
    return (f'the drive answers with {answered}, the profile says {listed}: correct the profile '
            f'to {correct}')


@sentence
def never_written(number: int) -> str:
    return f'parameter {number} is never written: its number marks cyclic frames'


@sentence
def contradicted(other: str) -> str:
    return f'{other} is the same parameter, and is given another value'


@sentence
def one_half(of: str, writable: bool) -> str:
    return f'one half of {of}: set that' if writable else f'read-only: one half of {of}'


# -- services -------------------------------------------------------------------------------------


@sentence
def rearm_would_jump(setpoint: str) -> str:
    return f'{setpoint} would jump: it has neutral_from, which needs rearm: neutral'


@sentence
def nobody_answered() -> str:
    return 'nobody answered: is its bridge still running?'


@sentence
def write_not_confirmed() -> str:
    return 'not confirmed: it may have been written'


@sentence
def answer_not_delivered(service: str) -> str:
    return (f'an answer of {service} could not be delivered: its caller takes none (another QoS, '
            f'or DDS has not found all of it)')


@sentence
def answers_hold_up(reason: str) -> str:
    return (f'answers hold up the whole process while they wait for a caller that DDS has not '
            f'found yet: rclpy sends them ({reason})')


# -- the log, and traces --------------------------------------------------------------------------


@sentence
def nothing_recorded() -> str:
    return 'nothing is recorded: set trace_seconds of a bus'


@sentence
def log_too_fast(lines: int) -> str:
    return f'{lines} lines of the log left out: they came faster than they could be written'


# -- diagnostics: how a bus is --------------------------------------------------------------------


@sentence
def bus_up(interface: str, channel: str) -> str:
    return f'{interface} {channel}'


@sentence
def bus_not_up(state: str, outlook: str) -> str:
    return f'{state}: {outlook}'


@sentence
def bus_disturbed(what: str, advice: str) -> str:
    return f'{what}: {advice}'


@sentence
def frames_overflowed(frames: int) -> str:
    return (f'{frames} received frames lost: this machine is too slow for the traffic, see what '
            f'else it does')


@sentence
def frames_not_sent(frames: int, why: str) -> str:
    return f'{frames} frames not sent: {why}'


@sentence
def bus_load_high(percent: float) -> str:
    return f'bus load {percent:.0f} %: raise the period of some drives or the bit rate'


# -- diagnostics: how a drive is, and what to do --------------------------------------------------


@sentence
def online() -> str:
    return 'online'


@sentence
def activate_bridge() -> str:
    return 'bridge inactive: activate it'


@sentence
def bridge_ended() -> str:
    return 'bridge ended: start it again'


@sentence
def stopped_for_defect(why: str) -> str:
    return (f'offline: {why}; told to stop, looked for again in a moment; please report this '
            f'defect of the bridge with its log')


@sentence
def bus_of_drive_down(bus: str) -> str:
    return f'bus {bus} is down'


@sentence
def bus_hangs(bus: str) -> str:
    return (f'bus {bus} hangs, its drives are not told anything: its adapter does not return from '
            f'a send')


@sentence
def bus_of_drive_opening(bus: str) -> str:
    return f'bus {bus} is not open yet'


@sentence
def never_seen(why: str) -> str:
    return (f'not seen since start: {why}; check its power, cable, station number and bit '
            f'rate')


@sentence
def not_seen(why: str) -> str:
    return f'not seen since start: {why}'


@sentence
def drives_missing(online: int, drives: int, missing: Collection[str]) -> str:
    return f'{online} of {counted(drives, "drive")} online; not seen: {", ".join(missing)}'


@sentence
def silent_since(since: str, why: str) -> str:
    return f'silent since {since}, was online before: check its power and cable ({why})'


@sentence
def maps_to_correct(why: str) -> str:
    return f'{why}; correct the drive or the configuration, or set mapping: configure'


@sentence
def drive_to_correct(why: str) -> str:
    return f'{why}; correct the drive or the configuration'


@sentence
def maps_not_kept(why: str) -> str:
    return (f'{why}; the drive does not keep the maps that are written: correct the drive or '
            f'the configuration')


@sentence
def fault(reset: str, which: str = 'fault') -> str:
    return f'{which}: remove its cause, then {reset}'


@sentence
def still_running(state: str) -> str:
    return f'told to stop, and still {state}'


@sentence
def disabled(enable: str) -> str:
    return f'disabled: {enable}'


@sentence
def disabled_and_commanded(enable: str) -> str:
    return f'disabled: {enable}; commands arrive, and change nothing'


@sentence
def not_armed(wanted: Sequence[str]) -> str:
    return f'not armed: publish {" and ".join(wanted)}'


@sentence
def slow_exchange(mean: float, period: float) -> str:
    return (f'an exchange takes {1e3 * mean:.0f} ms, the period is {1e3 * period:g} ms: the '
            f'drive is slow; choose a longer period or a shorter cyclic_response')


@sentence
def one_master_only(seen: str) -> str:
    return f'{seen}: there must be one master only'


@sentence
def frames_rejected(frames: int, last: str) -> str:
    return (f'{frames} frames rejected, the last: {last}; check for a second station with the '
            f'same number')


@sentence
def answer_late(seconds: float) -> str:
    late = 1e3 * seconds
    return (f'answer {late:.{int(late < 1.0)}f} ms after its period: the computer or the drive is '
            f'too slow')
