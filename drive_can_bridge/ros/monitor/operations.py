# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a person may ask of a drive: reads, writes, stops. Nothing here can move one."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from rcl_interfaces.srv import GetParameters, SetParameters
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.core.parameters import Value
from drive_can_bridge.core.text import printable
from drive_can_bridge.monitor.snapshot import is_ros_name
from drive_can_bridge.monitor.snapshot import Outcome, Stop
from drive_can_bridge.ros.client.calls import HasHandle, NodeCalls, Service
from drive_can_bridge.ros.messages import drive_value, parameter_message

#: s for a stop, which answers when the drive's status says so, and for a read or write
STOP_TIMEOUT = 10.0
PARAMETER_TIMEOUT = 15.0

#: service and request of each; ``enable`` is asked for its false only
_STOPS: dict[Stop, tuple[str, Any, Callable[[], Any]]] = {
    Stop.QUICK_STOP: ('quick_stop', Trigger, Trigger.Request),
    Stop.DISABLE: ('enable', SetBool, lambda: SetBool.Request(data=False)),
}
_SILENCE = Outcome(False, 'nobody answered: is its bridge still running?')


class Operations:
    """
    Services of drives, for those who see them through a monitor's node.

    :param node: of the monitor.
    """

    def __init__(self, node: HasHandle) -> None:
        self._node = node
        self._stops: dict[tuple[str, Stop], Service] = {}
        self._calls = NodeCalls(node, PARAMETER_TIMEOUT)

    def poll(self, stops: Mapping[str, Collection[Stop]], now: float) -> bool:
        """Take the answers that have arrived; return whether somebody still waits for one."""
        wanted = {(drive, stop) for drive, each in stops.items() for stop in each}
        for gone in self._stops.keys() - wanted:
            if not self._stops[gone].busy:
                self._stops.pop(gone).close()
        for drive, stop in wanted - self._stops.keys():
            name, kind, _ = _STOPS[stop]
            self._stops[drive, stop] = Service(self._node, kind, f'{drive}/{name}', STOP_TIMEOUT)
        for service in self._stops.values():
            if service.busy:
                service.look(now)
        self._calls.look(now)
        return self._calls.busy or any(service.busy for service in self._stops.values())

    def stop(self, drive: str, stop: Stop, done: Callable[[Outcome], None], now: float) -> None:
        """Stop a drive."""
        def take(response: Any) -> None:
            done(_SILENCE if response is None
                 else Outcome(response.success, printable(response.message)))
        service = self._stops.get((drive, stop))
        if service is None:
            done(Outcome(False, f'nobody offers {drive}/{_STOPS[stop][0]}: no control word, or '
                                f'its bridge does not run'))
        else:
            service.send(_STOPS[stop][2](), take, now)

    def write(self, drive: str, name: str, value: Value, done: Callable[[Outcome], None],
              now: float) -> None:
        """Write a parameter of a drive."""
        def take(response: SetParameters.Response | None) -> None:
            results = [] if response is None else response.results
            done(Outcome(results[0].successful, printable(results[0].reason)) if results
                 else _SILENCE)
        self._ask(drive, 'set_parameters',
                  SetParameters.Request(parameters=[parameter_message(name, value)]), take, now)

    def read(self, drive: str, names: Sequence[str],
             done: Callable[[Sequence[Value | None]], None], now: float) -> None:
        """Read parameters of a drive; None: could not be read."""
        def take(response: GetParameters.Response | None) -> None:
            answers = [] if response is None else [drive_value(v) for v in response.values]
            done((answers + [None] * len(names))[:len(names)])
        self._ask(drive, 'get_parameters',
                  GetParameters.Request(names=list(names)), take, now)

    def _ask(self, drive: str, service: str, request: Any, take: Callable[[Any], None],
             now: float) -> None:
        if is_ros_name(drive):
            self._calls.ask(drive, service, request, take, now)
        else:
            take(None)
