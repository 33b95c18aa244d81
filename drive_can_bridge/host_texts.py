# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Texts for people before anything that takes time may be imported, and the rule for patterns.

The texts have their fields in braces: ``drive_can stop`` sends a stop before it imports the
catalogue. :mod:`drive_can_bridge.core.host_sentences` has them as rows, with what to do.
"""

#: what makes a word a shell pattern
WILD = frozenset('*?[')


def is_pattern(text: str) -> bool:
    """Return whether a text is a shell pattern, and no name."""
    return not WILD.isdisjoint(text)


# -- results of a stop, or of another command
may_run = '{why}: may still be running'
drives_may_run = '{why}: its drives may still be running'
bridge_does_not_answer = 'this bridge does not answer: its drives may still be running'
bridges_hide_each_other = ('{number} bridges are called so, and one answer hides the other: '
                           'drives may still be running')
not_online_may_run = '{said}; not online: may still be running'
not_here = 'this bridge of this host ({where}) does not answer here'
order_unanswered = 'no answer for {waited:.0f} s (the computer may be busy)'
order_unoffered = 'nobody offers its ~/{service}: no control word, or its bridge has gone'
no_such_drive = 'no such drive; there are: {there}'
has_no_drives = 'has no drives: it is not configured'

# -- which bridges there are
no_bridge_running = 'no configured bridge is running {where}'
no_bridge_start_one = f'{no_bridge_running}: start one'
bridge_elsewhere = ('a bridge of this host runs in ROS domain {others}: export '
                    'ROS_DOMAIN_ID={first}')
bridge_elsewhere_stops = ('a bridge of this host runs in ROS domain {others}: `drive_can stop` '
                          'without a name stops it, too; for the rest export '
                          'ROS_DOMAIN_ID={first}')
no_bridge_but_elsewhere = f'{no_bridge_running}; {bridge_elsewhere}'
no_bridge_but_elsewhere_stops = f'{no_bridge_running}; {bridge_elsewhere_stops}'
no_bridge_answers = ('no bridge answers {where}: {silent} {do} not, for {waited:.0f} s (the '
                     'computer may be busy)')
domain_impossible = '{variable} is {domain}, allowed are 0 to {most}'

# -- the local way
version_differs = 'version {version} is understood here'
another_user = 'another user'
too_many_ask = 'too many ask'
local_way_failed = 'internal error in the local way: {kind}: {text}'

# -- the process itself
no_real_time = ('no real-time priority, periods are less regular on a busy machine; to allow it '
                'see docs/performance.md')
not_suspended = 'Ctrl-Z refused: drives would run on with nobody to stop them; Ctrl-C stops them'
output_not_read = 'drive_can_bridge: {lines} lines left out here: {output} was not read'
