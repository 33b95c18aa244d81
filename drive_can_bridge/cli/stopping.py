# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The results of commands by hand, and a stop that is over at once.

Where all bridges are of this host, ``drive_can stop`` ends here, with nothing imported but what
sends a stop and prints its results.
"""

from collections.abc import Collection, Iterable, Sequence
import sys

from drive_can_bridge import host_texts
from drive_can_bridge.cli.saying import FAILED, print_json, say
from drive_can_bridge.process.beginning import look_after_outputs
from drive_can_bridge.process.local_stop import Answer, Early, LocalStop
from drive_can_bridge.process.local_way import matches
from drive_can_bridge.process.presence import Present, short

#: s without a message after which the rest is imported, and how many are read before
_QUIET, _WORDS = 0.03, 1000
#: (command, whether it succeeded) -> what stands before the answer, where that does not say it
_VERDICTS = {('stop', False): 'NOT STOPPED', ('reset', True): 'reports no fault'}


class WithoutRos:
    """
    In place of the results of a stop through ROS, where none was sent there.

    :ivar seen: the bridges that are known there.
    :ivar heard: those that have answered.
    :ivar drives: full names of their drives.
    """

    seen: Collection[str] = ()
    heard: Collection[str] = ()
    drives: Collection[str] = ()

    def answers(self, present: Iterable[Present] = ()) -> list[Answer]:
        """Return the results of drives, and of bridges that do not answer."""
        return []


def finished(early: Early) -> int | None:
    """
    Wait for the answers to a stop that was sent by the local way, and print them.

    :return: the exit code; None: they take longer, or there may be bridges elsewhere.
    """
    stop: LocalStop = early.stop
    try:
        is_over = _answered(stop)
    except Exception:  # noqa: BLE001  whatever bridges answer: the way through ROS is there
        is_over = False
    if not is_over:
        stop.go_on(_QUIET)
        return None
    look_after_outputs()
    code = FAILED
    try:
        code = show(answers(stop, None, early.namespace, early.words), 'stop', json=early.json)
        sys.stdout.flush()
    except BrokenPipeError:     # its reader is gone
        pass
    except OSError as error:
        from drive_can_bridge.cli.command import complain   # takes its time
        complain(f'drive_can stop: {error.strerror or error}')
        return FAILED
    return code


def _answered(stop: LocalStop) -> bool:
    """Handle answers as long as they come at once; return whether these were all."""
    for _ in range(_WORDS):
        if stop.look(0.0):
            return True
        if stop.wants_ros(0.0) or not stop.wait(_QUIET):
            break
    return False


def answers(local: LocalStop, ros: WithoutRos | None, namespace: str | None,
            words: Sequence[str]) -> list[Answer]:
    """
    Return the results of a stop.

    :param ros: the part of it through ROS; None: none.
    :param words: names, patterns or full names of the drives that are meant; none: all.
    """
    through = ros or WithoutRos()
    heard = {short(name) for name in through.heard}
    told = [Answer(each.name, False, host_texts.drives_may_run.format(
        why=each.silence(local.domain)),
                   bridge=True)
            for each in local.unheard
            if each.domain != local.domain or each.name not in heard] + local.answers()
    named = {answer.name for answer in told if answer.bridge} | local.spared
    told += [answer for answer in through.answers(local.present)
             if not answer.bridge or short(answer.name) not in named]
    known = {*local.known, *through.seen}
    nodes = {answer.name for answer in told if not answer.bridge}
    there = ', '.join(node.lstrip('/') for node in dict.fromkeys(
        [*local.drives, *through.drives]))
    # without any, bridges have none, or have not said which
    told += [Answer(word, False, host_texts.no_such_drive.format(there=there)) for word in words
             if there and not any(matches(word, node) for node in nodes)]
    own = any(each.domain in (None, local.domain) for each in local.present)
    if not known and (not told or not own and ros is not None):
        from drive_can_bridge.process.environment import no_bridge     # takes its time
        # those of other domains may be all that there are, or discovery was too slow
        told.append(Answer('', bool(told), no_bridge(namespace, others_answer=bool(told)),
                           bridge=True))
    return told or [Answer(name, False, host_texts.has_no_drives, bridge=True)
                    for name in known]


def show(told: Sequence[Answer], order: str, *, json: bool) -> int:
    """
    Print the results, failures first; return the exit code.

    :param order: the command.
    :param json: print for a program.
    """
    for answer in sorted(told, key=lambda each: each.ok):
        name, elsewhere = answer.name.lstrip('/'), answer.domain is not None
        if json:
            from drive_can_bridge.core.codes import code_of     # takes its time: all is over
            print_json({'bridge' if answer.bridge else 'drive': name, 'ok': answer.ok,
                        'message': answer.text, 'code': code_of(answer.text),
                        **({'domain': answer.domain} if elsewhere else {})})
        else:
            verdict = _VERDICTS.get((order, answer.ok), '')
            say((f'[domain {answer.domain}] ' if elsewhere else '')
                + ': '.join(filter(None, (name, verdict, answer.text))))
    return 0 if told and all(answer.ok for answer in told) else FAILED
