# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Texts of processes of this host before the catalogue may be imported: its rows, by their codes.

Their texts stand in :mod:`drive_can_bridge.host_texts`; the rows add what to do.
"""

from drive_can_bridge import host_texts
from drive_can_bridge.core.messages import catalogue, Text

#: the advice behind all that may still be running
STANDS_STILL = (
    'make sure that the drive stands still; if not, stop it at its own panel or by its power')
#: the advice where bridges cannot be told apart
APART = 'end one, and start it again with --ros-args -r __ns:=/cell2 (launch: namespace:=cell2)'
_HANGS = 'see whether that process hangs; end it, and start the bridge again'
_SAME_VERSION = 'use a command of the same version as the bridge; the way through ROS is taken'

# -- drive_can stop, enable, disable, reset: what became of it ------------------------------------
may_run = Text(host_texts.may_run, do=STANDS_STILL)
drives_may_run = Text(host_texts.drives_may_run, do=STANDS_STILL)
bridge_does_not_answer = Text(
    host_texts.bridge_does_not_answer, do=f'{STANDS_STILL}; see whether the bridge hangs')
bridges_hide_each_other = Text(
    host_texts.bridges_hide_each_other, do=f'{STANDS_STILL}; {APART}')
not_online_may_run = Text(host_texts.not_online_may_run, do=STANDS_STILL)
not_here = Text(host_texts.not_here, do=_HANGS)
order_unanswered = Text(
    host_texts.order_unanswered,
    do='see diagnostics of the drive, and what else the computer does')
order_unoffered = Text(
    host_texts.order_unoffered,
    do='add a control section to its profile, or start its bridge; drive_can stop works without')
no_such_drive = Text(host_texts.no_such_drive, do='use one of these names')
has_no_drives = Text(
    host_texts.has_no_drives, do='see the log of the bridge: why it is not configured')
no_bridge_running = Text(
    host_texts.no_bridge_running, host_texts.no_bridge_start_one,
    host_texts.no_bridge_but_elsewhere, host_texts.no_bridge_but_elsewhere_stops,
    do='start a bridge, or export the ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE of the one '
       'that runs')
bridge_elsewhere = Text(
    host_texts.bridge_elsewhere, host_texts.bridge_elsewhere_stops,
    do='export that ROS_DOMAIN_ID in this shell, and start the command again')
no_bridge_answers = Text(host_texts.no_bridge_answers, do=_HANGS)
domain_impossible = Text(host_texts.domain_impossible, do='set that variable to such a number')

# -- the local way, and the process itself --------------------------------------------------------
version_differs = Text(host_texts.version_differs, do=_SAME_VERSION)
another_user = Text(
    host_texts.another_user,
    do='nothing: the way through ROS is taken; only a stop is heard from every user')
too_many_ask = Text(host_texts.too_many_ask, do='ask again with fewer commands at a time')
local_way_failed = Text(
    host_texts.local_way_failed,
    do='report it, with the log of the bridge; the way through ROS goes on')
no_real_time = Text(
    host_texts.no_real_time, do='nothing, or allow it as docs/performance.md says')
not_suspended = Text(host_texts.not_suspended, do='end it by Ctrl-C, which stops the drives')
output_not_read = Text(
    host_texts.output_not_read, do='read that output faster, or send it to a file')

#: all of them, by their codes
CODES = catalogue(globals())
