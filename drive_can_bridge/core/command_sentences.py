# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What commands, traces, imports and the panel say to people: every sentence, by its code.

Rows as in :mod:`.sentences`; where a row says nothing else, what to do is part of its text. Help
texts stand with their options.
"""

from drive_can_bridge.core.messages import catalogue, Text

# -- drive_can: how a command is typed ------------------------------------------------------------
nobody_can_be_asked = Text(
    '{otherwise}: nobody can be asked here; --yes {yes_means}',
    do='give --yes, knowing what it answers')
needs_yes = Text(
    '{who} needs --yes where nobody can be asked',
    do='give --yes, knowing what may happen')
nothing_was_sent = Text('nothing was sent', do='nothing')
number_above_zero = Text('{text}: allowed is a number above 0')
bitrate_wanted = Text('{text}: allowed are 1000 to 8000000 bit/s, also as 500k')
number_between = Text('{text}: allowed are {low} to {high}')
names_no_file = Text('{text} names no file')
no_namespace = Text('{text} is no namespace, write /cell1')
option_names_no_drive = Text("{option} {text}: no drive '{name}'; drives: {drives}")
option_written_so = Text('{option} {text}: write {example}')
two_wanted = Text('{words}: allowed are two, A and B')
through_bridge_only = Text(
    'goes through the running bridge: leave --params-file away',
    do='leave --params-file away; start the bridge')
full_names_only = Text('{word}: takes full names, no patterns', do='write the names of the drives')
seconds_at_most = Text('{text}: allowed are up to {most:g} s')
jog_words = Text('write DRIVE VALUE, or DRIVE NAME VALUE')
full_name_only = Text('{drive}: takes a full name, no patterns', do='write the name of the drive')
no_number_or_bool = Text('{value} is no value: write a number, or true or false')
trace_or_live = Text('give a trace file, or --live')
filter_names_no_drive = Text('--drive {drive}: no such drive; drives: {drives}')
would_write_over = Text('{file}: is read, and would be written over, choose another name')
plot_suffix = Text('--plot {plot}: its suffix says what is written: .png, .svg, .pdf, …')
bus_of_trace_only = Text('--bus: of a trace only')
word_unknown = Text('{word} is unknown; known are {known}')
bus_and_channel = Text('--bus {given}: give NAME=CHANNEL')
no_such_bus = Text('--bus {given}: no such bus; buses: {buses}')
bus_given_twice = Text('--bus {given}: this {what} is given twice')
namespace_with_file = Text(
    '--namespace is of a running bridge, --params-file goes without one',
    do='leave one of the two away')
nmt_start_with_bridge = Text(
    '--nmt-start goes with --params-file: a bridge starts its nodes itself',
    do='leave --nmt-start away, or give --params-file')
which_drive = Text('which drive? {said}There are: {there}')
names_several = Text('{word} names several drives: {found}', do='write the whole name of one')
which_drives = Text("which drive? '*' means all; {there}")
no_drive_of_word = Text('no drive {word}; {there}')
other_namespace = Text(
    '{word}: is not in namespace {namespace}, and one bridge is asked at a time',
    do='give the namespace of the drive by --namespace, or leave that option away')
no_subcommand = Text('there is no subcommand {word}')
json_wants_file = Text(
    '--json says on standard output what became of the file: say where the profile goes with -o '
    'FILE')
protocol_twice = Text('--protocols: one of them stands twice')
protocol_unknown = Text("--protocols: '{word}' is unknown, there are: {there}")
no_column = Text("--columns: '{word}' is no column, there are: {there}")
column_without_heading = Text('--columns: {column} has no heading, allowed is {column}=HEADING')
column_twice = Text('--columns: {column} stands twice')
option_of_eds = Text(
    '{option} is for EDS and DCF files, and {file} is none',
    do='leave that option away')
wireshark_for_log = Text('--wireshark: for .log, not {suffix}')
say_which_drive = Text('{file} {of}: say which one is meant; there are: {there}')
file_and_drive = Text('{words}: allowed is FILE [DRIVE]')
option_of_its_own = Text('--option {wrong}: there is --{option}')
bitrates_need_listening = Text(
    '--bitrates: {interface} has no listen-only mode here, and trying bit rates without it would '
    'disturb the bus',
    do='write the bit rate from the drive by --bitrate, or use an adapter that can listen only '
       '(docs/adapters.md)')
bitrates_write_nothing = Text(
    '--bitrates only counts frames, there is nothing to write: leave -o away')
scan_protocols = Text('{word}: allowed are {allowed}; the others are asked anyway')
key_and_value = Text('{text}: allowed is KEY=VALUE')
bitrates_wanted = Text(
    '{text}: allowed are bit rates separated by commas, 1000 and above, also as 500k')
ipv4_wanted = Text('{text}: an IPv4 address is wanted')
buses_on_one = Text(
    '{given} puts the buses {buses} on one: use --pty, or a parameter file with one bus')
pty_or_interface = Text(
    '--pty and --interface/--channel exclude each other',
    do='leave one of them away')
no_object_written = Text("'{part}' is no object; write 6007h or 1800h.05h")
no_drive_without = Text('{index:04X}h: without it there is no drive', do='leave that object there')
option_of_other_family = Text(
    '{option} {name}: it is a drive of {protocol}, allowed are those of {allowed}')
no_simulated_drive = Text("no drive '{word}'; drives: {drives}; also: status, list, help")
value_missing = Text('what is to be written? NAME=VALUE is missing')
name_and_value = Text('{word}: allowed is NAME=VALUE; nothing was written')
name_twice = Text('{name} stands twice; nothing was written')
one_file_for_several = Text('{count} drives ({names}) do not go into one file: write -o {wanted}/')

# -- drive_can: what a command needs, and does not find -------------------------------------------
library_hangs = Text(
    'drive_can adapters: {interface}: its library does not come back',
    do='unplug that adapter, or leave it: the others are listed')
no_adapters = Text(
    'drive_can adapters: none found: no CAN interface of the kernel, no serial port, nothing that '
    'the libraries of makers know; a gateway that does not announce itself is not found '
    '(docs/adapters.md)',
    do='plug it in; see whether the kernel has a driver for it (dmesg)')
argcomplete_missing = Text(
    'the Python module argcomplete is not installed: python3-argcomplete, or the extra '
    "'completion' of this package",
    do='install it')
matplotlib_missing = Text(
    'drive_can decode: --plot needs the Python module matplotlib (package python3-matplotlib, or '
    '{command})',
    do='run that command')
plot_failed = Text('drive_can decode: --plot {path}: {error}', do='what the reason says')
trace_empty = Text(
    '{file}: there is no frame in it',
    do='see whether it is the right file, and whether the recording had begun')
no_such_channel = Text(
    '--bus {bus}: the trace has no such channel',
    do='use a channel as the trace shows it')
more_like_that = Text('{name}: {count} more like that', do='see what the lines before say')
view_ended = Text(
    'the view has ended ({end}); bridge and drives run on until Ctrl-C, and drive_can monitor '
    'shows them',
    do='nothing, or end it by Ctrl-C')
drives_not_started = Text('{title}: the simulated drives did not start', do='see the lines before')
process_ended = Text(
    '{what} has ended ({end}); the others run on until Ctrl-C',
    do='end it by Ctrl-C, and start it again')
process_killed = Text(
    '{what} did not end in {patience:g} s and was killed',
    do='see what else the computer does')
module_missing = Text(
    '{command}: this needs a Python module that is not installed: {module}',
    do='install that module (docs/installation.md)')
internal_error_of_command = Text(
    '{command}: internal error, please report it: {kind}: {text}',
    do='report it, with the command and this line')
extra_missing = Text(
    '{command}: the Python module {module} is not installed: {how}',
    do='run that command')
no_text = Text('is no text: it contains NUL characters', do='export the table as CSV, in UTF-8')
no_such_text = Text(
    'begins like {encoding} text and is none: byte {byte} ({reason})',
    do='export the table as CSV, in UTF-8')
no_directory_above = Text('{above}: no such directory', do='make that directory')
not_writable = Text(
    '{above}: cannot be written to',
    do='choose another directory, or ask for the right to write there')
is_a_directory = Text('{file}: is a directory', do='write the name of a file')

# -- drive_can backup, restore, compare: what they say of settings --------------------------------
no_file_written = Text(
    '{drive}: no file was written{advice}',
    do='see why these could not be read; --partial writes what was read')
no_settings = Text(
    '{drive}: has no settings that could be written to a file',
    do='use the profile of that drive: a list of parameters that can be written')
other_profile = Text(
    '{have_not}: is this its profile? No file was written',
    do='use the profile of that drive; see drive_can scan and its EDS file')
setting_left_out = Text(
    'warning: {drive}: {name} is left out: {reason}',
    do='correct minimum and maximum in the profile')
drive_has_not_all = Text(
    '{drive}: does not have {absent} of the {settings} of {profile} ({named})',
    do='nothing, or use the profile of that drive')
beyond_profile = Text(
    'the drive has {value}, the profile allows {allowed}',
    do='correct minimum and maximum in the profile')
nothing_in_common = Text(
    '{words} have no setting in common ({one} and {other}): they are of different drive types',
    do='compare drives of one type; see what each file is of')
backup_of_other_profile = Text(
    'warning: {file} was made with another profile ({profile}) than the one of {drive} ({its})',
    do='see what has changed in the profile')
no_settings_left_out = Text(
    '{word}: left out, because no settings: {count} values ({names}{more})',
    do='nothing: they are values that only show something')
restore_while_enabled = Text(
    '{drive}: is enabled: settings are not written while it may move. Disable it first. '
    '{nothing}.',
    do='disable it, then restore again')
enabled_unknown = Text(
    '{drive}: whether it is enabled is not known; it should stand still',
    do='see that it stands still, then answer')
of_other_type = Text(
    '{file}: of another drive type: {other}',
    do='use the backup of this drive type; --force writes what fits')
force_restores = Text(
    '{nothing}; --force restores it all the same.',
    do='give --force, knowing what the lines before say')
profile_not_said = Text(
    '{file}: does not say of which profile it is: whether it suits {drive} is not checked',
    do='compare its names with the profile')
mode_not_told = Text(
    '{drive}: the bridge does not tell in which mode the drive takes settings; {nothing}. '
    '--params-file goes without it, --force does not ask',
    do='update the bridge, or give --params-file')
no_value_in_backup = Text(
    '{file}: no value in it, left alone: {names}',
    do='nothing, or write a value there')
nothing_to_restore = Text(
    '{drive}: nothing to restore, {same} settings are as in {file}',
    do='nothing')
gone_without_power = Text(
    '{drive}: gone when it loses power: {names} ({why})',
    do="store them by the drive's own way, where it has one")
restore_interrupted = Text(
    '{drive}: {why}. Written: {written}. Not written: {not_written}. {again} the command to go on',
    do='repeat the command: only what differs is written')
restore_incomplete = Text(
    '{drive}: confirmed: {confirmed}; not as in the file:',
    do='see the reasons below it')
restored = Text('{drive}: {count} written, {read} read back: as in the file{modes}', do='nothing')
setting_left_alone = Text('{drive}: {name} is left alone: {why}', do='what the reason says')
ending_after_write = Text(
    '{drive}: ending after the write under way',
    do='wait; it is verified first')
nothing_read = Text(
    '{drive}: nothing could be read: {reason}\n{nothing}.',
    do='see diagnostics of the drive')
nothing_read_from = Text(
    '{drive}: nothing could be read: {reason}',
    do='see diagnostics of the drive')
not_read = Text('{drive}: {name} could not be read: {reason}', do='what the reason says')
other_value_refused = Text(
    'another value of this command is refused',
    do='correct the other value; nothing was written')
waiting_for_drive = Text(
    '{drive}: answers no more; waiting up to {patience:g} s for it, so that {aim}',
    do='see what it does; power it up again where it stays silent')

# -- drive_can scan, record, monitor: what they say of a bus --------------------------------------
probe_unacknowledged = Text(
    'bus {bus}: {error}: no other node acknowledges',
    do='switch on the drive; check cable, termination and bit rate')
scan_unacknowledged = Text(
    '{error}: no other node acknowledges',
    do='switch on a drive; check cable, termination and bit rate')
wireshark_loses = Text(
    'warning: --wireshark does not keep directions',
    do='leave --wireshark away to keep them')
suffix_loses = Text(
    'warning: {suffix} does not keep {loss}; .log does',
    do='choose .log to keep it')
record_lost = Text(
    'bus {bus}: {lost} frames lost: this machine is too slow for the traffic',
    do='see what else the computer does')
only_listening = Text(
    'there is another master ({master}): only listening',
    do='end it to have drives asked, or leave it: what it asks shows them, too')
no_file_without_drives = Text(
    '{output}: not written, no drive was found',
    do='see what it says of the bus')
controller_state = Text(
    'the controller of this adapter is {controller}',
    do='check cable, termination and bit rate')
scan_trouble = Text('{trouble}: check power, cable, termination and bit rate', do='check them')
nothing_at_any_rate = Text(
    'nothing was heard at any of these; drives speak when they are asked, so a master has to be '
    'running',
    do='start the master, or scan at the bit rate that a drive shows on its display')
not_asked_beside_canopen = Text(
    '{name} is not asked: there is a CANopen node ({nodes}), which might take its reads for '
    'process data',
    do='ask it on a bus of its own')
error_frames_seen = Text('{count} error frames{told}', do='check cable, termination and bit rate')
no_drive_found = Text(
    'no drive found, {frames} frames heard',
    do='see what it says of the bus; --protocols for drives with 11-bit identifiers')
online_unknown = Text(
    '{said}; nobody says whether it is online',
    do='see diagnostics of the drive')
internal_error_of_bridge = Text(
    'drive_can_bridge: internal error, please report it: {kind}: {text}',
    do='report it, with the log of the bridge')

#: all of them, by their codes
CODES = catalogue(
    globals(), do='write it as the text says; drive_can SUBCOMMAND --help has examples')
