# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A drive's parameters as the parameters of its node.

The six standard services, so that ``ros2 param`` and rqt_reconfigure work on a drive. Reading and
writing goes over acyclic frames: the callbacks are coroutines, which wait for the session's answer
without blocking other calls (:mod:`.threads`).
"""

from collections.abc import Callable, Sequence
from typing import Any

from rcl_interfaces.msg import (
    ListParametersResult, Parameter as ParameterMessage, ParameterDescriptor, ParameterEvent,
    ParameterType, ParameterValue, SetParametersResult,
)
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParameters,
    SetParametersAtomically,
)
from rclpy.node import Node
from rclpy.qos import qos_profile_parameter_events

from drive_can_bridge.core import sentences
from drive_can_bridge.core.directory import contradictions, NAME_SHOWN, ParameterDirectory
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import RestoreTable
from drive_can_bridge.core.requests import (
    Failure, Outcome, ReadRequest, ReadValue, Request, WriteRequest, Written)
from drive_can_bridge.core.roles import Role
from drive_can_bridge.core.text import printable, TEXT_MAX
from drive_can_bridge.ros.coroutines import Awaited
from drive_can_bridge.ros.drive_services import CoroutineServices
from drive_can_bridge.ros.messages import value_of
from drive_can_bridge.ros.stamps import Stamps
from drive_can_bridge.ros.threads import ServiceThread
from drive_can_bridge.ros.values import descriptor, PARAMETER_TYPES, parameter_value

#: names in one call
NAMES_MAX = 1000
#: names of one call that are logged, and looked at for what else might be meant, one by one
TOLD_MAX = 16
#: of a name without a value: one for all, since making one takes 10 us
_NOT_SET = ParameterValue()
#: separates the levels of a parameter name (rcl_interfaces/srv/ListParameters)
SEPARATOR = '.'


class ParameterServices:
    """
    The parameter services of one drive.

    :ivar services: to be started, and destroyed.
    :param stamps: of parameter events.
    :param thread: serves them.
    :param submit: submits a request to the drive's session; answered by one outcome per parameter.
    :param write_refusal: why users may not write a parameter now, or ''.
    :param role: what the bridge itself uses a parameter for.
    :param active: returns whether the bridge is active; nothing is sent otherwise.
    :param restore: of the drive's profile.
    :param failed: called with (what was tried, reason) for log and diagnostics, and how many
        parameters failed without having reached the session, which counts the others.
    """

    def __init__(self, node: Node, thread: ServiceThread, directory: ParameterDirectory,
                 stamps: Stamps, *, submit: Callable[[Request], Awaited[tuple[Outcome, ...]]],
                 write_refusal: Callable[[Parameter], str],
                 role: Callable[[Parameter], Role | None],
                 active: Callable[[], bool], restore: RestoreTable,
                 failed: Callable[[str, str, int], None]) -> None:
        self._node = node
        self._directory = directory
        self._stamps = stamps
        self._submit = submit
        self._write_refusal = write_refusal
        self._role = role
        self._active = active
        self._restore = restore
        self._failed = failed
        self._unreadable: set[str] = set()  # what the drive did not give when last asked
        self._errors: dict[str, str] = {}   # why there was no value, whatever the reason
        self.services = CoroutineServices(node, thread, {
            'get_parameters': (GetParameters, self._get),
            'set_parameters': (SetParameters, self._set),
            'set_parameters_atomically': (SetParametersAtomically, self._set_atomically),
            'list_parameters': (ListParameters, self._list),
            'describe_parameters': (DescribeParameters, self._describe),
            'get_parameter_types': (GetParameterTypes, self._types)})
        self._events = node.create_publisher(ParameterEvent, '/parameter_events',
                                             qos_profile_parameter_events)

    def _excess(self, names: Sequence[str], what: str) -> str:
        """
        Return why a call asks for too much to be processed; '' if it does not.

        It must not delay the calls behind it: neither its names are looked up, nor is each
        of them logged.
        """
        if len(names) > NAMES_MAX:
            reason = sentences.names_in_call(names=len(names), most=NAMES_MAX)
        elif any(len(name) > TEXT_MAX for name in names):
            reason = sentences.name_too_long(most=TEXT_MAX)
        else:
            return ''
        self._failed(what, reason, len(names))
        return reason

    # -- reading ----------------------------------------------------------------------------------

    async def _get(self, request: Any, response: Any) -> Any:
        excess = self._excess(request.names, 'read parameters')
        if excess:
            response.values = [_NOT_SET] * len(request.names)
            return response
        found = [self._directory.find(name) for name in request.names]
        self._tell('read', [
            (name, self._directory.unknown(name, hint=place < TOLD_MAX))
            for place, (name, parameter) in enumerate(zip(request.names, found))
            if parameter is None])
        values: dict[int, ParameterValue] = {}
        if self._active():
            wanted = [(place, parameter) for place, parameter in enumerate(found)
                      if parameter is not None and parameter.readable]
            if wanted:
                outcomes = await self._submit(
                    ReadRequest(tuple(parameter for _, parameter in wanted)))
                failed: list[tuple[Parameter, Failure]] = []
                for (place, parameter), outcome in zip(wanted, outcomes):
                    if isinstance(outcome, ReadValue):
                        values[place] = parameter_value(
                            parameter, parameter.value_from_raw(outcome.raw))
                        self._unreadable.discard(parameter.name)
                        self._errors.pop(request.names[place], None)
                    elif isinstance(outcome, Failure):
                        if parameter.listed and not outcome.kind.of_bridge:
                            self._unreadable.add(parameter.name)
                        failed.append((parameter, outcome))
                        self._remember(request.names[place], outcome.reason)
                self._tell_outcomes('read', failed)
        elif request.names:
            for name, known in zip(request.names, found):
                if known is not None:
                    self._remember(name, sentences.bridge_inactive())
            self._failed('read parameters', sentences.bridge_inactive(),
                         sum(parameter is not None for parameter in found))
        response.values = [values.get(place, _NOT_SET) for place in range(len(found))]
        return response

    def _remember(self, name: str, reason: str) -> None:
        """Keep for ``describe_parameters`` why there is no value: a raw name may be anything."""
        if len(self._errors) >= NAMES_MAX:
            self._errors.pop(next(iter(self._errors)))
        self._errors[name] = reason

    async def _list(self, request: Any, response: Any) -> Any:
        if self._excess(request.prefixes, 'list parameters'):
            return response
        response.result = list_parameters(list(self._directory.listed), list(request.prefixes),
                                          request.depth)
        return response

    async def _describe(self, request: Any, response: Any) -> Any:
        if self._excess(request.names, 'describe parameters'):
            each = {name: ParameterDescriptor(name=printable(name)) for name in request.names}
            response.descriptors = [each[name] for name in request.names]
            return response
        # rcl_interfaces/srv/DescribeParameters: as many descriptors as names, in the same order
        found = [(name, self._directory.find(name)) for name in request.names]
        response.descriptors = [
            ParameterDescriptor(name=name) if parameter is None
            else descriptor(name, parameter, role=self._role(parameter),
                            unreadable=name in self._unreadable,
                            error=self._errors.get(name, ''))
            for name, parameter in found]
        return response

    async def _types(self, request: Any, response: Any) -> Any:
        if self._excess(request.names, 'types of parameters'):
            response.types = [ParameterType.PARAMETER_NOT_SET] * len(request.names)
            return response
        found = [self._directory.find(name) for name in request.names]
        response.types = [
            ParameterType.PARAMETER_NOT_SET if parameter is None
            else PARAMETER_TYPES[parameter.kind] for parameter in found]
        return response

    # -- writing ----------------------------------------------------------------------------------

    async def _set(self, request: Any, response: Any) -> Any:
        excess = self._excess([message.name for message in request.parameters],
                              'set parameters')
        if excess:
            response.results = [SetParametersResult(reason=excess)] * len(request.parameters)
            return response
        results: list[SetParametersResult] = [
            SetParametersResult() for _ in request.parameters]
        items: list[tuple[int, Parameter, int]] = []
        refused = []
        for place, message in enumerate(request.parameters):
            try:
                items.append((place, *self._checked(message, hint=place < TOLD_MAX)))
            except ValueRefused as error:
                results[place] = SetParametersResult(reason=str(error))
                refused.append((message.name, str(error)))
        self._tell('set', refused)
        if items:
            outcomes = await self._submit(WriteRequest(
                tuple((parameter, raw) for _, parameter, raw in items),
                # a silent drive is not to be left in it
                blind=all(self._restore.ends_mode(parameter.name, parameter.word_from_raw(raw))
                          for _, parameter, raw in items)))
            written = []
            failed: list[tuple[Parameter, Failure]] = []
            for (place, parameter, raw), outcome in zip(items, outcomes):
                name = request.parameters[place].name
                results[place] = _result(outcome)
                if isinstance(outcome, Failure):
                    failed.append((parameter, outcome))
                if isinstance(outcome, Written):
                    written.append((name, parameter, raw))
            self._tell_outcomes('set', failed)
            self._announce(written)
        response.results = results
        return response

    async def _set_atomically(self, request: Any, response: Any) -> Any:
        excess = self._excess([message.name for message in request.parameters],
                              'set parameters')
        if excess:
            response.result = SetParametersResult(reason=sentences.nothing_written(excess))
            return response
        items: list[tuple[Parameter, int]] = []
        for message in request.parameters:
            try:
                items.append(self._checked(message))
            except ValueRefused as error:
                return self._nothing_set(response, message.name, str(error))
        for message, contradicted in zip(request.parameters, contradictions(items)):
            if contradicted:
                return self._nothing_set(response, message.name, contradicted)
        if not items:
            response.result = SetParametersResult(successful=True)
            return response
        outcomes = await self._submit(WriteRequest(tuple(items), atomic=True))
        names = [message.name for message in request.parameters]
        results = list(map(_result, outcomes))
        self._tell_outcomes('set', [
            (parameter, outcome) for (parameter, _), outcome in zip(items, outcomes)
            if isinstance(outcome, Failure)])
        self._announce([(name, parameter, raw) for name, (parameter, raw), outcome
                        in zip(names, items, outcomes) if isinstance(outcome, Written)])
        # one reason when all parameters share it, else each with its name
        reasons = [result.reason for result in results]
        failed = [f'{name}: {result.reason}' for name, result in zip(names, results)
                  if not result.successful]
        text = reasons[0] if len(set(reasons)) == 1 else '; '.join(failed)
        response.result = SetParametersResult(
            successful=all(result.successful for result in results), reason=text)
        return response

    def _nothing_set(self, response: Any, name: str, reason: str) -> Any:
        """Refuse all of a call for one of its names."""
        shown = printable(name, NAME_SHOWN)
        reason = sentences.nothing_written(f'{shown}: {reason}')
        self._failed(f'set {shown}', reason, 1)
        response.result = SetParametersResult(reason=reason)
        return response

    def _checked(self, message: ParameterMessage, *, hint: bool = True) -> tuple[Parameter, int]:
        """
        Find the parameter that is to be set, and its raw integer.

        :param hint: for an unknown name, look for the nearest known one.
        :raises ValueRefused: in words.
        """
        parameter = self._directory.find(message.name)
        if parameter is None:
            raise ValueRefused(self._directory.unknown(message.name, hint=hint))
        if not self._active():
            raise ValueRefused(sentences.bridge_inactive())
        refusal = self._write_refusal(parameter)
        if refusal:
            raise ValueRefused(refusal)
        return parameter, self._directory.raw_from_user(parameter, value_of(message.value))

    def _tell(self, what: str, failures: Sequence[tuple[str, str]]) -> None:
        """Log what failed before anything was sent, name and reason; the first ones by name."""
        for name, reason in failures[:TOLD_MAX]:
            self._failed(f'{what} {printable(name, NAME_SHOWN)}', reason, 1)
        more = len(failures) - TOLD_MAX
        if more > 0:
            self._failed(f'{what} parameters', sentences.more_names_failed(more), more)

    def _tell_outcomes(self, what: str, failures: Sequence[tuple[Parameter, Failure]]) -> None:
        """Log the failures of a call; of names that are not at fault and fail alike, the first."""
        alike: dict[tuple[str, Parameter | None], list[Parameter]] = {}
        for parameter, failure in failures:
            of_name = None if failure.kind.of_bridge else parameter
            alike.setdefault((failure.reason, of_name), []).append(parameter)
        for (reason, _), (first, *more) in alike.items():
            others = f' and {len(more)} more' if more else ''
            self._failed(f'{what} {first.name} ({first.address}){others}', reason, 0)

    def _announce(self, written: list[tuple[str, Parameter, int]]) -> None:
        if not written:
            return
        self._events.publish(ParameterEvent(
            stamp=self._stamps.now(),
            node=self._node.get_fully_qualified_name(),
            changed_parameters=[
                ParameterMessage(name=name, value=parameter_value(
                    parameter, parameter.value_from_raw(raw)))
                for name, parameter, raw in written]))


def list_parameters(names: list[str], prefixes: list[str], depth: int) -> ListParametersResult:
    """
    Select names by the rules of rcl_interfaces/srv/ListParameters.

    :param prefixes: none means all names; otherwise a name that equals one or lies below one.
    :param depth: number of levels below the prefix (or in all); 0 means all.
    """
    result = ListParametersResult()
    found_prefixes: set[str] = set()
    for name in names:
        if prefixes:
            inside = any(
                name == prefix or name.startswith(prefix + SEPARATOR) and (
                    depth == 0 or name[len(prefix) + 1:].count(SEPARATOR) < depth)
                for prefix in prefixes)
        else:
            inside = depth == 0 or name.count(SEPARATOR) < depth
        if inside:
            result.names.append(name)
            if SEPARATOR in name:
                found_prefixes.add(name.rsplit(SEPARATOR, 1)[0])
    result.prefixes = sorted(found_prefixes)
    return result


def _result(outcome: Outcome) -> SetParametersResult:
    if isinstance(outcome, Written):
        return SetParametersResult(successful=True, reason=outcome.note)
    return SetParametersResult(
        successful=False, reason=outcome.reason if isinstance(outcome, Failure) else 'no result')
