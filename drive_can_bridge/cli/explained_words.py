# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What ``drive_can explain`` knows besides the catalogue: keys, numbers, verdicts."""

import re

from drive_can_bridge.core.host_sentences import STANDS_STILL
from drive_can_bridge.core.messages import Text

#: what each key of diagnostics means
KEYS = {
    'adapter_latency_ms': 'how long a USB converter keeps what it has received',
    'broadcast': 'who leads the broadcast group',
    'bus_off_count': 'how often the controller went bus-off, as far as the adapter reports it',
    'code': 'the message (of several the first) as a stable word: give that to drive_can explain',
    'command_age_s': 'age of the oldest command in force, in s; nan: none is',
    'commands_refused': 'commands with a value that cannot be sent, or that came too late',
    'control_state': 'the state that the drive reports',
    'emergency': 'the last emergency message of the node',
    'error_frames': 'error frames, as far as the adapter reports them',
    'exchanges': 'exchanges that the drive answered',
    'fault_code': 'number and name of the fault; empty: there is none, or it was not readable',
    'frames_received': 'frames received from the bus',
    'frames_rejected': 'of a drive: malformed or unasked frames on its identifiers; of a bus: '
                       'frames of no configured drive',
    'frames_sent': 'frames sent to the bus',
    'last_parameter_error': 'why the last read or write of a parameter failed',
    'late_answers': 'answers that came after their time: computer, adapter or drive is too slow',
    'latency_max_ms': 'longest time from request to answer',
    'latency_mean_ms': 'mean time from request to answer',
    'latency_p99_ms': 'time from request to answer that 99 of 100 do not exceed',
    'load_percent': 'bus load since the last status, both directions',
    'missed_exchanges': 'exchanges that the drive did not answer in time',
    'nmt_state': 'NMT state, as the node reports it',
    'parameter_requests_failed': 'parameters that were not read, or not written',
    'parameter_requests_ok': 'parameters that were read or written',
    'period_error_max_ms': 'largest distance of the real period from the configured one',
    'period_error_mean_ms': 'mean distance of the real period from the configured one',
    'period_error_p99_ms': 'distance of the real period from the configured one that 99 of 100 '
                           'do not exceed',
    'reconnections': 'how often the bus was opened again after a failure or loss',
    'send_failures': 'frames that were not sent',
    'short_frames': 'answers with fewer than 8 bytes that held what was needed',
    'state': 'state of the bus, or of the drive: offline, mapping differs, fault, disabled, '
             'not armed, online',
    'stops_by': 'what quick stop and disable do on this drive, and what stops it when the bridge '
                'is lost',
}
#: four hexadecimal digits, as messages write them
_NUMBER = re.compile(r'(?:0x)?([0-9a-f]{4})h|0x([0-9a-f]{4})', re.IGNORECASE)


def _coded(code: str, *texts: str, do: str) -> Text:
    row = Text(*texts, do=do)
    row.code = code
    return row


#: what stands before the reason in a line of a command, or of the log
VERDICTS = {
    row.code: row for row in (
        _coded('not_stopped', '{drive}: NOT STOPPED: {why}', 'NOT STOPPED: {why}',
               do=f'{STANDS_STILL}; then see what the reason says'),
        _coded('no_fault_now', '{drive}: reports no fault: {why}', do='enable the drive to go on'),
        _coded('drive_went_offline', '{drive}: offline: {why}', 'offline: {why}',
               do='see what the reason says; then power, cable, station and bit rate of the '
                  'drive: the bridge goes on looking for it'))}
_KEYS = {key: _coded(key, f'{key}: {{value}}', do=meaning) for key, meaning in KEYS.items()}


def rows_of_word(word: str) -> dict[str, Text]:
    """Return the rows of a word that is no code of the catalogue, by what they are about."""
    number = _NUMBER.fullmatch(word)
    if number is not None:
        digits = (number[1] or number[2]).upper()
        return {'numbers': _coded(
            word, f'{digits}h',
            do='in a fault or emergency: an error code, behind "status word": its bits, else an '
               "object's index; the manual of the drive's maker has them")}
    return {about: rows[word] for about, rows in (('keys', _KEYS), ('verdicts', VERDICTS))
            if word in rows}
