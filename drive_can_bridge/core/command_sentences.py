# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Texts of commands, traces, imports and the panel, each with its code.

Rows as in :mod:`.sentences`; where a row has no advice, what to do is part of its text. Help
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
no_number_or_bool = Text('{value} is no value: write a number without its unit, or true or false')
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
    do='leave one of them away: --pty makes buses of its own')
link_in_use = Text(
    '--pty-link: {link} belongs to {process}, which runs: end that first, or give another '
    'directory',
    do='end the other simulation, or give another directory')
no_object_written = Text("'{part}' is no object; write 6007h or 1800h.05h")
no_drive_without = Text(
    '{index:04X}h: no servo can be simulated without it', do='take it out of --without')
option_of_other_family = Text(
    '{option} {name}: it is a drive of {protocol}, allowed are those of {allowed}')
no_simulated_drive = Text("no drive '{word}'; drives: {drives}; also: status, list, help")
value_missing = Text('what is to be written? NAME=VALUE is missing')
name_and_value = Text('{word}: allowed is NAME=VALUE; nothing was written')
name_twice = Text('{name} stands twice; nothing was written')
one_file_for_several = Text(
    '{count} drives ({names}) do not go into one file: write -o {wanted}/',
    do='write -o with a / behind the name: a directory, with a file for each drive')

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
no_text = Text('is not a text file: it contains NUL characters',
               do='export the table as CSV, in UTF-8')
no_such_text = Text(
    'begins like {encoding} text and is none: byte {byte} ({reason})',
    do='export the table as CSV, in UTF-8')
no_directory_above = Text('{above}: no such directory', do='make that directory')
not_writable = Text(
    '{above}: cannot be written to',
    do='choose another directory, or ask for the right to write there')
is_a_directory = Text('{file}: is a directory', do='write the name of a file')

# -- drive_can backup, restore, compare: texts on settings ----------------------------------------
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
backups_of_two_profiles = Text(
    'warning: {one} and {other} were made with different profiles, or versions of one '
    '({profiles}); units and names of values are those of {read_by}',
    'warning: {one} and {other} were made with different profiles, or versions of one '
    '({profiles}), and neither is here: values are compared without units',
    do='compare backups of the same kind of drive, made with the same profile')
no_settings_left_out = Text(
    '{word}: left out, because no settings: {count:#value} ({names}{more})',
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
nothing_read_from = Text(
    '{drive}: nothing could be read: {reason}',
    do='see diagnostics of the drive')
not_read = Text('{drive}: {name} could not be read: {reason}', do='what the reason says')
other_value_refused = Text(
    'another value of this command is refused',
    do='correct the other value; nothing was written')
value_without_name = Text(
    'warning: {drive}: {name} is {value} now, which is none of the values that the profile names '
    '({names:, }): what the drive does then, its manual says',
    fields='name value names drive',
    do='look whether its manual has that value')
waiting_for_drive = Text(
    '{drive}: answers no more; waiting up to {patience:g} s for it, so that {aim}',
    do='see what it does; power it up again where it stays silent')

# -- drive_can scan, record, monitor: texts on a bus ----------------------------------------------
probe_unacknowledged = Text(
    'bus {bus}: {error}: no other node acknowledges',
    do='switch on the drive; check cable, termination and bit rate')
bitrate_not_given = Text(
    'warning: --bitrate is not given: {bitrate} bit/s is assumed; an adapter at another rate than '
    'the drives disturbs their bus',
    do='give the bit rate of the drives: a display, a switch or their manual shows it')
bitrate_of_interface = Text(
    'warning: --bitrate {given} does not change the interface: {name} is set to {bitrate} bit/s '
    '(ip link set {name} down, then: ip link set {name} up type can bitrate {given})',
    do='leave --bitrate away, or set the interface to that of the drives')
node_of_no_family = Text(
    'CANopen node {node}: {text}: no drive of a known family, as far as was heard',
    do='leave --passive away to have it asked')
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
    'bus {bus}: {lost:#frame} lost: this machine is too slow for the traffic',
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
nothing_answered = Text(
    'nothing was heard: no drive answers at this bit rate; check power, cable and termination, '
    'try the other bit rate that a drive shows or its manual names (--bitrate), and --protocols '
    'for drives with 11-bit identifiers',
    do='check these; give --protocols for drives with 11-bit identifiers')
nothing_heard = Text(
    'nothing was heard: drives speak when they are asked',
    do='leave --passive away where no other master is on the bus')
error_frames_seen = Text('{count} error frames{told}', do='check cable, termination and bit rate')
no_drive_found = Text(
    'no drive found, {frames:#frame} heard',
    do='see what it says of the bus; --protocols for drives with 11-bit identifiers')
online_unknown = Text(
    '{said}; nobody says whether it is online',
    do='see diagnostics of the drive')
internal_error_of_bridge = Text(
    'drive_can_bridge: internal error, please report it: {kind}: {text}',
    do='report it, with the log of the bridge')

# -- traces: what is wrong with a file, and messages of a recorder --------------------------------
trace_bytes_damaged = Text(
    '{count} bytes are damaged',
    do='nothing: the rest is read; record again where these matter')
trace_object_short = Text(
    'entry {number}: an object of type {kind} is too short',
    do='nothing: the rest is read')
trace_doubled = Text(
    'frames that stand twice, going out and coming back (a capture of "any"): {count}; each is '
    'taken once',
    do='nothing: each counts once')
scapy_missing = Text(
    '{path}: {suffix} needs the Python module scapy (package python3-scapy, or pip install scapy)',
    do='install it')
packet_in_part = Text(
    'entry {number}: a packet was captured in part',
    do='record again with a larger snap length')
times_added_up = Text(
    'times are those since the line before (candump -t d): added up',
    do='nothing, or record with candump -t a')
no_time = Text('{word} is no time', do='correct that line, or record again')
unknown_suffix = Text(
    '{path}: no trace format has the suffix {suffix}; known are {known}, and .gz behind those of '
    'text',
    do='give it one of these suffixes, if it is of that format')
trace_read_only = Text('a trace is read only')
suffix_not_written = Text(
    '{path}: no trace is written with the suffix {suffix}; known are {known}',
    do='choose one of these')
suffix_of_one_bus = Text(
    '{path}: {suffix} does not tell buses apart, and there are {buses}; choose .log',
    do='choose .log')
no_candump_line = Text(
    'neither a line of a candump log nor of its screen',
    do='see whether it is a trace of candump')
data_bytes_differ = Text(
    '{found} data bytes instead of {wanted}',
    do='correct that line, or record again')
identifier_digits = Text(
    'an identifier of {digits} digits',
    do='correct that line, or record again')
frames_not_written = Text('{count} frames are not written', do='see whether the disk is full')
frames_in_a_line = Text('more than one frame in a line', do='correct that line, or record again')
rest_not_unpacked = Text(
    'the rest cannot be unpacked: {error}',
    do='copy the file again: it is cut or damaged')
trace_cut = Text(
    'the rest cannot be read: it is damaged, or cut',
    do='copy the file again, or record again')
rest_not_read = Text(
    'the rest cannot be read: {failure}',
    do='copy the file again: it is cut or damaged')
no_db_entry = Text('entry {number}: no entry of a .db trace', do='nothing: the rest is read')
recording_ended = Text(
    'the recording has ended',
    do='activate the bridge: it records while it is active')
trace_written = Text(
    'bus {bus}: trace of {reason}, {count:#frame} of the last {seconds:g} s: {path}',
    do='read it: drive_can decode FILE')
trace_without_frames = Text(
    'bus {bus}: not a single frame in the last {seconds:g} s',
    do='see whether the bus is up, and drives are on it')
asammdf_missing = Text(
    '{path}: .mf4 needs the Python module asammdf (pip install asammdf)',
    do='install it')
trc_without_columns = Text(
    'version {version}, and no ;$COLUMNS= says where time, type, identifier and length are',
    do="save it again by PEAK's program")
trc_length_differs = Text(
    'its length is {length}, and there are {found} data bytes',
    do='nothing: the rest is read')
trc_start_time = Text(
    '$STARTTIME is not a number of days: {value}',
    do='correct that line, or save it again')
nothing_to_plot = Text(
    'nothing to plot: none of these values is in the trace',
    do='name values that drive_can decode shows of this trace')
plot_names_no_drive = Text("--plot {text}: no drive '{drive}'; drives: {drives}")
plot_names_no_value = Text(
    "--plot {text}: {drive} has no '{name}'",
    do='use a name of cyclic_request or cyclic_response of that drive')
time_goes_back = Text(
    'goes back by {seconds:.6f} s: the clock was set, or two traces are in one',
    do='nothing: times count from there')
error_of_frame = Text('error of the frame {frame}', do='check cable, termination and bit rate')

# -- drive_can panel: what it refuses -------------------------------------------------------------
panel_full = Text(
    'too many connections are open already: try again in a while',
    do='close other pages of the panel')
panel_too_much = Text('too much at once: at most {most} bytes', do='upload a backup of one drive')
panel_other_name = Text(
    'this panel does not answer to that name: use the address that drive_can panel has printed',
    do='use that address, or start it with --host and that name')
panel_no_token = Text(
    'no valid token: open the address that drive_can panel has printed when it started, with its '
    'token',
    do='copy the whole address from the terminal in which drive_can panel runs')
panel_other_origin = Text(
    'another page has sent this (Origin): refused',
    do='open the panel itself; behind a proxy, pass Host and Origin on')
panel_other_site = Text(
    'another page has sent this (Sec-Fetch-Site): refused',
    do='open the panel by its own address, not by a link of another page')
panel_without_writes = Text(
    'this panel was started without --allow-writes',
    do='start it with --allow-writes, or write by drive_can write')
panel_busy = Text(
    'others are at it already: try again in a moment',
    do='try again in a moment: one write or restore runs at a time')
panel_needs_operator = Text(
    "{what} needs the operator's token; this browser came with the viewer's",
    do='open the address of the operator that drive_can panel has printed')
panel_wrong_kind = Text(
    'say it in {kind}',
    do='reload the page; a program has to send that content type')
panel_no_json = Text(
    'that is no JSON object',
    do='reload the page; a program has to send a JSON object')
panel_no_parameter = Text(
    '{drive} has no such parameter',
    do='reload the page: the profile is another one')
panel_no_value = Text(
    '{name}: no value, allowed is a string: what a person types',
    do='reload the page; a program has to send the value as text')
panel_no_drive = Text('no drive {name} here', do='reload the page; see whether its bridge runs')
panel_knows_no_parameters = Text(
    '{drive} has not told of its parameters yet',
    do='wait until its bridge has answered')
panel_too_late = Text(
    'not done after {seconds:.0f} s: ended',
    do='see diagnostics of the drive, then look at its parameters')
panel_command_failed = Text('drive_can {command} failed', do='see what the lines below it say')
no_word_to_disable = Text(
    'no control word: only quick stop stops it',
    do='use quick stop, or ~/enable false where its profile has a control section')

# -- drive_can profile import: what is wrong with a file ------------------------------------------
profile_too_large = Text(
    'the profile of its {entries} entries would be larger than {most} MiB, which no bridge reads',
    do='name fewer columns or objects; leave out what is not needed')
no_directory = Text(
    '{directory} is no directory', do='make the directory, or write the path of one')
no_file = Text('{name}: no such file')
cell_unknown = Text(
    "{what} '{text}' is none of those that are known here",
    do='write it as docs/profiles.md has it')
quote_open = Text('in line {line} a quote opens that is never closed', do='correct that line')
no_table_column = Text("no column '{word}': the table has {width}")
limits_fit_no_type = Text(
    'the limits fit no type of 16 or 32 bits',
    do='name the type in a column of its own')
bits_form = Text("bits '{text}' are not of the form 0=ready, 3=fault")
elements_from_one = Text("'{text}': elements in brackets are counted from 1")
cells_not_split = Text(
    'line {line}: cannot be split into cells: {error}',
    do='correct that line, or export the table again')
no_number_column = Text(
    'no column with parameter numbers was found; {what}; say which one it is: --columns '
    'number=HEADING,name=HEADING,... (or their places: number=1)')
cell_too_long = Text(
    'a cell over several lines holds as much as a row: is a quote missing?',
    do='close the quote that opens there')
row_without_number = Text('has no number', do='nothing, or write its number')
limits_exchanged = Text(
    'minimum {low:g} is above maximum {high:g}',
    do='exchange them, or correct them by the manual')
no_canopen_index = Text(
    "'{index}' is no index of CANopen, which begin at 1000h; if it is a number, say --columns "
    'number=HEADING,index=')
address_out_of_range = Text(
    '{key} {found} is out of range, allowed is 0 to {most}',
    do='correct it by the manual')
limit_in_other_unit = Text(
    "{key} '{number:g} {unit}' is not in {own}",
    do='write the limit in the unit of the parameter')
no_eds = Text(
    'is no EDS or DCF file: it has no section of an object, like [1000]',
    do='ask the maker of the drive for its EDS file')
no_number = Text("'{text}' is no number", do='correct it by the manual')
octal_or_not = Text(
    "'{text}' may be {value} or, octal, {octal}",
    do='write it without leading zeros, or as 0x…')
no_scale = Text("'{text}' is no scale", do='correct it by the manual')
canopen_missing = Text(
    'needs the Python library canopen, which is not installed: {how}',
    do='run that command')
data_type_empty = Text('DataType is empty', do='correct it by the manual')
data_type_missing = Text('DataType is missing', do='correct it by the manual')
data_type_of_other_width = Text(
    'data type {code:04X}h is {width}',
    do='nothing: no bridge exchanges such a value')
no_object_but_type = Text('describes a type of data, and is no object', do='nothing')
compact_out_of_range = Text('CompactSubObj {count} is out of range', do='correct it by the manual')
no_subindices = Text('has no sub-indices in the file', do='ask the maker for a whole file')
section_missing = Text('section [{section:04X}] is missing', do='ask the maker for a whole file')
same_address = Text('the same address as in line {first}', do='nothing: the first one counts')
no_object_section = Text('is no section of an object', do='nothing')
object_not_understood = Text('is no object that can be understood', do='correct it by the manual')
decimal_or_grouping = Text("'{text}' may be {one:g} or {other}: say which with --decimal")
no_range = Text("'{text}' is no range", do='write it as 0 … 100, or as two columns')
scale_zero = Text("'{text}': a scale must not be 0", do='correct it by the manual')
divides_by_zero = Text("'{text}' divides by zero", do='correct it by the manual')

# -- traces and imports: which channel, which column, which axis ----------------------------------
channel_of_no_bus = Text(
    'channel {channel}: no bus of the parameter file; if it is one, give {options: or }',
    do='give that option, if it is that bus')
which_channel = Text(
    'the trace has the channels {channels:, }; which of them is bus {bus} of the parameter file? '
    'Give {options: or }',
    do='give one of these options')
panel_not_there = Text(
    'drive_can panel: {host}, port {port}: {why}{advice}',
    do='choose another port by --port, or an address of this machine by --host')
other_port = Text('; --port chooses another', do='give --port with another number')
other_host = Text(
    ': no address of this machine, --host chooses another',
    do='give --host with an address of this machine (ip address shows them)')
no_such_headings = Text('no row has the headings {missing:, }; there are: {there:, }')
no_entry_usable = Text(
    'no entry can be used; the first reason, in line {reason}',
    'no entry can be used: there is none',
    do='see the reasons above; compare the table with docs/profiles.md')
no_such_axis = Text(
    'has no axis {wanted}, it has {axes:, }',
    'has no axis {wanted}, it has none: there is no control word, 6040h')
device_is_no_drive = Text(
    'is no drive: its device type (1000h) is {kind:08X}h, profile {profile}{what}, and it has no '
    'control word, 6040h; --force imports it all the same')
head_missing = Text(
    'section [{index:04X}] is missing; what is imported are its sub-indices', do='nothing')
cell_empty = Text('it is empty', do='correct it by the manual')

# -- backups and simulated drives: what is wrong with a file, or an option ------------------------
value_of_other_type = Text(
    'wrong type: {value} is {found}, allowed is {allowed}',
    do='correct that line of the backup')
value_not_finite = Text('{value} is not a finite number', do='correct that line of the backup')
backup_of_several = Text(
    'has sections of {count} nodes ({names}), allowed is one',
    do='give the file of one drive')
backup_without_node = Text(
    'has no parameters of any node: this is no backup',
    do='give a file that drive_can backup or ros2 param dump has written')
bridge_file_no_backup = Text(
    'is a parameter file of a bridge, not a backup of a drive (it has {keys})',
    do='give a file that drive_can backup or ros2 param dump has written')
no_backup_value = Text(
    '{found}, allowed is a number, true or false',
    do='correct that line of the backup')
backup_name_too_long = Text(
    'a name longer than {most} characters',
    do='correct that line of the backup')
backup_without_parameters = Text(
    'has no parameters: this is no backup',
    do='give a file that drive_can backup or ros2 param dump has written')
habit_impossible = Text("'{part}' is not possible; allowed: {allowed}")
no_sto_input = Text(
    '{drive} has no input for safe torque off',
    do='use another fault: list shows them')
simulated_no_parameter = Text("{drive} has no parameter '{name}'")
simulated_no_value = Text(
    "'{text}' is no value of {name}, which is {kind}",
    do='type a number, or a name of the values of the profile')
simulated_fault_unknown = Text(
    "unknown fault '{word}'{hint}; allowed: {allowed}",
    do='type list at the simulator, or see drive_can simulate --help')
simulated_fault_form = Text(
    "'{text}' is not a fault, write {usage}",
    do='type list at the simulator, or see drive_can simulate --help')
simulated_fault_argument = Text("'{argument}' is not possible, write {usage}: {meaning}")

#: all of them, by their codes
CODES = catalogue(
    globals(), do='write it as the text says; drive_can SUBCOMMAND --help has examples')
