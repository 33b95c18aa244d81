# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What both families have in common beside the other stack: our bridge, and its dictionaries."""

from collections.abc import Mapping
from typing import Any

from builders import text_of
import pytest
from waiting import clock, wait_for

from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import Event, ProcessDataReceived, RequestCompleted
from drive_can_bridge.core.requests import Request
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.protocols.families import FAMILIES, make_sessions

objectdictionary = pytest.importorskip('canopen.objectdictionary')

#: s after which a thing that has not happened never will
DEADLINE = 30.0


def dictionary_of(variables: Mapping[int, tuple[str, int]],
                  records: Mapping[int, Mapping[int, int]],
                  objectdictionary: Any = objectdictionary) -> Any:
    """
    Return an object dictionary of the other stack.

    :param variables: index -> (name, type).
    :param records: index -> sub-index -> type.
    :param objectdictionary: the module of that stack.
    """
    od = objectdictionary.ObjectDictionary()

    def variable(name: str, index: int, subindex: int, data_type: int) -> Any:
        made = objectdictionary.ODVariable(name, index, subindex)
        made.data_type = data_type
        return made

    for index, (name, data_type) in variables.items():
        od.add_object(variable(name, index, 0, data_type))
    for index, entries in records.items():
        record = objectdictionary.ODRecord(f'object {index:X}', index)
        for subindex, data_type in entries.items():
            record.add_member(variable(f'entry {subindex}', index, subindex, data_type))
        od.add_object(record)
    return od


class Bridge:
    """The part of a bridge that is about one bus, with one drive: its exchange."""

    def __init__(self, bus: BusConfiguration, configuration: DriveConfiguration) -> None:
        self.session, = make_sessions([configuration])
        routes = [claim.route for claim in FAMILIES[configuration.protocol].claims(configuration)]
        self.exchange = BusExchange(bus, [self.session], [routes], self, clock())
        self.exchange.attach(self.session, self)
        self.events: list[Event] = []
        self.samples: list[tuple[int, ...]] = []
        self.failures: list[str] = []

    def __enter__(self) -> 'Bridge':
        self.exchange.open()
        self.exchange.activate()
        return self

    def __exit__(self, *_: Any) -> None:
        self.exchange.deactivate()
        self.exchange.close()
        assert not self.failures

    # what the exchange tells

    def nothing(self, *_: Any, **__: Any) -> None:
        """Take no notice."""

    take_commands = request_sent = discard_commands = bus_opened = nothing

    def process_data(self, event: ProcessDataReceived) -> None:
        self.samples.append(event.raws)

    def handle_event(self, event: Event) -> None:
        self.events.append(event)

    def bus_lost(self, bus: str, reason: str) -> None:
        self.failures.append(reason)

    def fatal(self, bus: str, reason: str, *, misconfigured: bool) -> None:
        self.failures.append(reason)

    # what a test asks

    def facts(self, key: str) -> str:
        with self.exchange.lock:
            return self.session.facts()[key]

    def online(self, wanted: bool = True) -> None:
        wait_for(lambda: self.session.online is wanted, f'online: {wanted}')

    def found(self, kind: type, request: Any) -> Any:
        return wait_for(lambda: next((event for event in list(self.events) if isinstance(
            event, kind) and event.request is request), None), f'the end of {request}')

    def outcome(self, request: Request) -> list[object]:
        """Submit a request; return its outcomes."""
        self.exchange.submit(self.session, request)
        return [text_of(each) for each in self.found(RequestCompleted, request).outcomes]

    def control(self, action: ControlAction) -> bool:
        """Ask for a control action; tell whether it succeeded."""
        request = ControlRequest(action)
        self.exchange.submit(self.session, request)
        return bool(self.found(ControlCompleted, request).success)
