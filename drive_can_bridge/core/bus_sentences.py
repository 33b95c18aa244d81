# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Texts about buses and adapters, each with its code.

Rows as in :mod:`.sentences`. The words of an adapter, its library or the kernel stand in them
as it is.
"""

from enum import Enum

from drive_can_bridge.core.messages import catalogue, Text


class BusLoss(Enum):
    """What the reason of a lost bus shows of its adapter."""

    UNPLUGGED = 'it has gone, and the bus goes on when it is back'


# -- buses and adapters: why a bus does not open --------------------------------------------------
no_socketcan = Text(
    'this kernel has no SocketCAN: "modprobe can_raw" loads it where there is one (some '
    'containers and virtual machines have none)',
    do='run sudo modprobe can_raw on the host; a container needs the network of the host; '
       'drive_can simulate --pty-link DIR needs no CAN')
interface_renamed = Text(
    'interface {name} is called {other} now: write it as channel, or "ip link set {other} down", '
    '"ip link set {other} name {name}"',
    do='write that name as channel, or give the interface its old name by these commands')
interface_gone = Text(
    'interface {name} is gone: unplugged, or deleted',
    do='plug it in again, or make it again; the bus goes on by itself')
interface_unknown = Text(
    'there is no interface {name}; CAN interfaces here: {names:, }',
    'there is no interface {name}; CAN interfaces here: none',
    do='write one of these names as channel; none: see drive_can adapters, and whether the driver '
       'of the adapter is loaded (dmesg)')
interface_down = Text('interface {name} is down: {how_up}', do='run that command as root')
adapter_not_there = Text(
    'adapter {adapter} is not there: check its plug and its name',
    do='plug it in; see drive_can adapters for the names that there are')
adapter_refuses_bitrate = Text(
    'the adapter refuses bit rate {bitrate}',
    do='write a bitrate that it has, the same as that of the drives (docs/adapters.md)')
adapter_not_opening = Text(
    'the adapter does not open',
    do='unplug it and plug it in again; one without listen-only mode refuses listen_only')
not_given_back = Text(
    'the adapter or its library does not come back from opening it',
    do='unplug the adapter and plug it in again; update its firmware or driver')
port_in_use = Text(
    'the serial port is used by {holder}; a drive has one master: end that first',
    do='end that process (ps shows what it is)')
in_use = Text(
    '{what} is used by {process}; {advice}',
    do='end that process, or let it do what is wanted: a drive has one master')
wait_or_end = Text(
    'wait until it is done, or end it',
    do='wait, or end that process (stands behind a text that names it)')
gateway_silent = Text(
    '{gateway} does not answer',
    do='see whether socketcand runs there, and whether a firewall lets its port through')
gateway_refuses = Text(
    '{gateway} refuses',
    do='start socketcand there, and look at host and port')
gateway_failed = Text('{gateway}: {why}', do='look at host, port and the network')
gateway_refuses_channel = Text(
    '{gateway} refuses channel {channel}: {words}',
    do='start socketcand with that interface (-i), and bring the interface up there')
gateway_of_other_kind = Text(
    '{gateway} is no socketcand',
    do='look at host and port: another program listens there')

# -- buses and adapters: why a bus is lost --------------------------------------------------------
adapter_gone = Text(
    'adapter {adapter} is gone: unplugged?',
    kinds=[BusLoss.UNPLUGGED],
    do='plug it in again: the bus goes on by itself; look at plug, cable and USB power')
down_until_back = Text('{reason} Goes on by itself when it is back', do='plug it in again')
down_and_tried = Text(
    '{reason}; tried again every {period:g} s',
    do='what the reason says; the bus is opened again by itself')
gateway_closed = Text(
    '{gateway} has closed the connection',
    do='see whether socketcand, its host and the network still run')
receive_failed = Text('receive: {why}', do='look at the adapter; see what the reason says')
other_end_closed = Text(
    'receive: the adapter has nothing, and does not wait: its other end has closed',
    do='see what has ended at the other end: the program, the connection or the device')
malformed_in_row = Text(
    'receive: {count} malformed frames in a row, check the settings of the adapter',
    do='look at interface and adapter of the bus, at its rate, and what else uses the port')
queue_full = Text(
    'send: transmit queue full',
    do='look whether another node is switched on, at cable, termination and bit rate')
send_failed = Text('send: {why}', do='look at the adapter; see what the reason says')
adapter_takes_no_data = Text(
    'the adapter takes no more data',
    do='look whether it hangs: unplug it and plug it in again; a slower bus or a faster line')
port_was_closed = Text('the port was closed', do='nothing; the bus is opened again by itself')
controller_bus_off = Text(
    'bus-off; {advice}; "ip link set {channel} down" and "up" start the controller again, "type '
    'can restart-ms 100" lets it do so by itself',
    do='check cable, shield, termination and bit rate, then run these commands')
not_read_yet = Text(
    'being opened, nothing read from it yet',
    do='wait a moment; where that stays, see what drive_can adapters says of the adapter')

# -- buses and adapters: what to check, and what happens to frames --------------------------------
nobody_acknowledges = Text(
    'no other node acknowledges: check that one is switched on, cable, termination and bit rate',
    do='switch on a drive; check cable, termination (120 ohms at both ends) and bit rate')
bus_is_disturbed = Text(
    'check cable, shield, termination and bit rate',
    do='check them: one wire open, two terminations, another bit rate, a cable beside that of a '
       'motor')
frames_were_lost = Text(
    'frames were lost: less traffic, or a faster machine',
    do='see what else the computer does; longer periods')
look_at_wires = Text(
    'check the wires between transceiver and bus',
    do='check CAN_H and CAN_L: open, short-circuited, exchanged')
adapter_refuses_frames = Text(
    'the adapter refuses frames',
    do='look whether another node acknowledges; see what the adapter does not send '
       '(docs/adapters.md)')
adapter_echoes = Text(
    'the adapter hands back what it was handed to send: one frame is dropped for each; look for a '
    'setting of it that ends this',
    do='nothing, or switch its echo off (docs/adapters.md)')
interface_at_other_bitrate = Text(
    'bitrate: {given} does not change the interface: {name} is set to {bitrate} bit/s '
    '(ip link set {name} down, then: ip link set {name} up type can bitrate {given})',
    do='write the bit rate of the drives as bitrate, or set the interface to it')
library_lines_left_out = Text(
    '{count} more lines of libraries left out',
    do='see what the lines before say; --ros-args --log-level shows no more')
bus_open_again = Text('bus {bus}: open again', do='nothing')
more_not_shown = Text(
    '{line} (more like it are not shown)',
    do='see what the lines before say')

# -- drive_can adapters: texts on an adapter ------------------------------------------------------
switch_on = Text('switch it on: {how_up}', do='run that command as root')
behind_port_unknown = Text(
    'what is behind this port does not show: an SLCAN adapter is written so',
    do='write these lines for an SLCAN adapter; another one: docs/adapters.md')
port_keeps = Text(
    'keeps what it receives for {milliseconds:g} ms: {remedy}',
    do='run that command, for good by a udev rule (docs/adapters.md)')
port_not_allowed = Text(
    'this user may not open it: sudo usermod -aG dialout $USER, log in again',
    do='run that command, and log in again')

#: all of them, by their codes
CODES = catalogue(globals())
