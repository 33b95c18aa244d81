# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a bridge answers by the local way (:mod:`..process.local_way`).

Nothing is decided here: requests end where the services of the drives end, in the same
threads, with the same checks and answers.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
import os
import threading
from typing import Any

from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, ListParameters, SetParameters)

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction, ControlCompleted
from drive_can_bridge.host_texts import is_pattern
from drive_can_bridge.process.local_server import LocalRequest, LocalServer
from drive_can_bridge.process.local_stop import does_not_answer
from drive_can_bridge.process.local_way import (
    ANYWHERE, meant, Rubbish, value_of, value_text)
from drive_can_bridge.process.presence import in_namespace, Presence, switched_on
from drive_can_bridge.process.scheduling import raise_priority
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.messages import limits_of, parameter_message, value_of as value_in
from drive_can_bridge.ros.passing import OthersStop
from drive_can_bridge.ros.threads import CpuThrottle, ExecutorThread

#: what is asked of drives, and what that is
_ACTIONS = {'enable': ControlAction.ENABLE, 'disable': ControlAction.DISABLE,
            'reset': ControlAction.RESET_FAULT}
#: share of the processor's time for whatever is asked, and s that may be used at once: 200 stops
_SHARE, _IN_HAND = 0.15, 0.02
#: s for which the bridges that were seen are taken for those that there are
_SEEN_FOR = 0.2
#: patterns in a stop, and characters of each: callers may send any, and matching takes time
_PATTERNS_MAX, _PATTERN_MAX = 16, 256


def security_enforced() -> bool:
    """Return whether SROS2 decides who may stop drives."""
    return (os.environ.get('ROS_SECURITY_ENABLE') == 'true'
            and os.environ.get('ROS_SECURITY_STRATEGY') == 'Enforce')


class LocalWayServer:
    """
    Answers on the socket of this bridge's presence until it is closed.

    :param name: full name of the bridge.
    :param drives: by name, as they are.
    :param order: their names in the order of the configuration.
    :param seen: returns the full names of all bridges in the graph, ours among them, and those of
        the drives that are seen around them.
    :param get: handles ``get_parameters`` of the bridge, in the thread of the spinner.
    :param warn: logs a warning.
    """

    def __init__(self, presence: Presence, domain: int, name: str,
                 drives: Mapping[str, DriveNode], order: Sequence[str], *,
                 seen: Callable[[], tuple[list[str], list[str]]],
                 get: Callable[[Any, Any], Any], spinner: ExecutorThread,
                 pass_on: Callable[[OthersStop, LocalRequest], None],
                 warn: Callable[[str], None], clock: Clock) -> None:
        self._domain = domain
        self._name = name
        self._drives = drives
        self._order = order
        self._seen = seen
        self._seen_at, self._found = -_SEEN_FOR, (list[str](), list[str]())
        self._get = get
        self._spinner = spinner
        self._pass_on = pass_on
        self._warn = warn
        self._clock = clock
        self._server: LocalServer | None = None
        if not switched_on():
            return
        if presence.taken:
            warn(sentences.local_name_taken())
            return
        self._server = LocalServer(
            presence.socket, self.serve, open_to_all=not security_enforced(), report=warn,
            prepare_thread=raise_priority,
            keep_share=lambda: CpuThrottle(_SHARE, clock, _IN_HAND).keep, clock=clock)

    def close(self) -> None:
        """Stop answering."""
        if self._server is not None:
            self._server.stop()

    def serve(self, asked: LocalRequest) -> None:
        """Start to answer. In the listening thread, so nothing may wait here."""
        if asked.action == 'stop':
            self._stop(asked)
        elif asked.action in _ACTIONS:
            self._command(asked, _ACTIONS[asked.action], self._named(asked.words))
        elif asked.action == 'who':
            self._introduce(asked)
            asked.end()
        elif asked.action == 'pass':
            self._pass(asked)
        elif asked.action in _CALLS:
            self._call(asked)
        else:
            asked.refuse(sentences.unknown_order())

    # -- commands by hand -------------------------------------------------------------------------

    def _stop(self, asked: LocalRequest) -> None:
        place, words = ''.join(asked.words[:1]), asked.words[1:]
        if _is_costly(asked.words):
            asked.refuse(sentences.too_many_patterns())
            return
        if place != ANYWHERE and not in_namespace(self._name, place):
            asked.answer('bridge', self._name, str(self._domain))
            asked.end()
            return
        self._command(asked, ControlAction.QUICK_STOP,
                      {drive.full_name: drive for drive in list(self._drives.values())
                       if meant(words, drive.full_name)}, introduce=True)

    def _pass(self, asked: LocalRequest) -> None:
        """Pass a stop on to those of its bridges that are seen: a caller may name any."""
        stop = OthersStop.of(asked.words)
        if _is_costly(stop.words):
            asked.refuse(sentences.too_many_patterns())
            return
        seen = set(self._around()[0]) - {self._name}
        known = [name for name in stop.bridges if name in seen]
        for name in stop.bridges:
            if name not in seen:    # it has left meanwhile
                asked.answer('passed', name, '0', does_not_answer(), '1')
        if known:
            self._pass_on(stop._replace(bridges=tuple(known)), asked)
        else:
            asked.end()

    def _named(self, names: Sequence[str]) -> dict[str, DriveNode | None]:
        known = {drive.full_name: drive for drive in list(self._drives.values())}
        return {name: known.get(name) for name in names}

    def _command(self, asked: LocalRequest, action: ControlAction,
                 drives: Mapping[str, DriveNode | None], *, introduce: bool = False) -> None:
        """Run an action on drives, all at once; the last one that is done ends the answer."""
        left, counting = len(drives) + 1, threading.Lock()

        def done() -> None:
            nonlocal left
            with counting:
                left -= 1
                last = not left
            if last:
                asked.end()

        def completed(name: str, drive: DriveNode, outcome: ControlCompleted) -> None:
            asked.answer('drive', name, f'{outcome.success:d}', f'{drive.told_online:d}',
                         str(outcome.message))
            done()
        for name, drive in drives.items():
            if drive is None or not drive.offers(action):
                asked.answer('unoffered', name)
                done()
            else:
                drive.command(action, partial(completed, name, drive), whom=asked.whom)
        if introduce:
            self._introduce(asked)      # takes a moment: drives come first
        done()

    def _introduce(self, asked: LocalRequest) -> None:
        """Answer with the name of the bridge, its drives, and the other bridges."""
        bridges, drives = self._around()
        asked.answer('drives', *(self._drives[name].full_name for name in self._order
                                 if name in self._drives))
        asked.answer('around', *drives)
        asked.answer('bridge', self._name, str(self._domain), *bridges)

    def _around(self) -> tuple[list[str], list[str]]:
        """Return the bridges that are seen, and the drives around them."""
        now = self._clock.now()
        if now - self._seen_at >= _SEEN_FOR:
            self._seen_at, self._found = now, self._seen()
        return self._found

    # -- parameters -------------------------------------------------------------------------------

    def _call(self, asked: LocalRequest) -> None:
        node, words = ''.join(asked.words[:1]), asked.words[1:]
        drive = self._named([node])[node]
        try:
            service, request, show = _CALLS[asked.action](words)
        except (IndexError, Rubbish):
            asked.refuse(sentences.makes_no_sense())
            return

        def answer(response: Any) -> None:
            for message in show(request, response):
                asked.answer(*message)
            asked.end()
        if drive is not None and asked.action == 'status':
            drive.tell_condition(lambda facts: answer(facts.items()))
        elif drive is not None:
            drive.call(service, request, answer)
        elif node == self._name and asked.action == 'get':
            self._spinner.later(lambda: answer(self._get(request, GetParameters.Response())))
        else:
            asked.refuse(sentences.no_such_node())


def _is_costly(words: Sequence[str]) -> bool:
    """Return whether it takes long to match words."""
    patterns = [word for word in words if is_pattern(word)]
    return len(patterns) > _PATTERNS_MAX or any(len(word) > _PATTERN_MAX for word in patterns)


#: of what is asked: service, request, and what its response is in messages
_Call = tuple[str, Any, Callable[[Any, Any], list[Sequence[str]]]]


def _getting(words: list[str]) -> _Call:
    return 'get_parameters', GetParameters.Request(names=words), lambda _, response: [
        ('value', value_text(value_in(each))) for each in response.values]


def _describing(words: list[str]) -> _Call:
    def show(_: Any, response: Any) -> list[Sequence[str]]:
        return [('described', each.name, each.description, each.additional_constraints,
                 *map(value_text, limits_of(each))) for each in response.descriptors]
    return 'describe_parameters', DescribeParameters.Request(names=words), show


def _listing(_: list[str]) -> _Call:
    return 'list_parameters', ListParameters.Request(), lambda _, response: [
        ('names', *response.result.names)]


def _setting(words: list[str]) -> _Call:
    name, value = words[0], value_of(words[1])
    if not isinstance(value, (bool, int, float)):
        raise Rubbish

    def show(_: Any, response: Any) -> list[Sequence[str]]:
        return [('result', f'{each.successful:d}', each.reason) for each in response.results]
    return 'set_parameters', SetParameters.Request(
        parameters=[parameter_message(name, value)]), show


def _asking_status(_: list[str]) -> _Call:
    return '', None, lambda _, facts: [('fact', *fact) for fact in facts]


_CALLS: dict[str, Callable[[list[str]], _Call]] = {
    'get': _getting, 'describe': _describing, 'list': _listing, 'set': _setting,
    'status': _asking_status}
