# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The checks of buses and drives: each by itself, and the drives of a bus together.

A drive is built even when parts of it are wrong, with defaults in place of the wrong parts, so
that everything else about it can be checked in the same run.
"""

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
import math
import pathlib
from typing import Any, Protocol

from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.configuration.profile_check import LoadedProfile
from drive_can_bridge.configuration.profiles import ProfileStore
from drive_can_bridge.configuration.schema import ALL_OPTIONS, complete, definition
from drive_can_bridge.core import complaints
from drive_can_bridge.core.adapter import AdapterTraits, S7_RATES
from drive_can_bridge.core.complaints import hint, suggestion, suggestion_of_profile
from drive_can_bridge.core.configuration import (
    BusConfiguration, convertible_units, DriveConfiguration, ELECTRICAL_FREQUENCY,
    JointConfiguration, JointQuantity, si_factor)
from drive_can_bridge.core.continuous import steps_of
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import AccessMode, Parameter, Storage, ValueKind
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.core.text import duration_text, nearest, seems_limit, show
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import Claim, Complaint, Family

#: how similar a key has to be to one of ours to count as misspelt
_SLIP = 0.8
#: the name of several adapters for a mode in which they send nothing
_LISTEN_ONLY = 'listen_only'
_COMMAND = '_command'
#: what makers call the control word, see ``_plain``
_CONTROL_WORD = 'controlword'
_KEYS = tuple(quantity.value + suffix for suffix in ('', _COMMAND) for quantity in JointQuantity)


class Adapters(Protocol):
    """
    What is known about CAN adapters (the module :mod:`drive_can_bridge.transport.adapters`).

    Passed as an argument, because only the transport knows python-can, and because a check without
    it is still useful.
    """

    def adapter_keywords(self, interface: str) -> set[str] | None:
        """Return the keyword arguments that an adapter's class names; None: unknown."""

    def missing_keywords(self, interface: str, given: Container[str]) -> list[str]:
        """Return the required keys of an adapter's class that are missing."""

    def check_interface(self, interface: str) -> Sentence | None:
        """Return why an interface cannot be used here; None: it can."""

    def check_channel(self, interface: str, channel: str | int) -> Sentence | None:
        """Return why a channel is impossible for an interface; None: it may be possible."""

    def check_bitrate(self, interface: str, bitrate: int) -> Sentence | None:
        """Return why an adapter cannot be set to a bit rate; None: it may be possible."""

    def serial_port(self, bus: BusConfiguration) -> tuple[str, ...]:
        """Return what the serial port of a bus is known by here; empty: there is none."""

    def check_name(self, interface: str, name: str) -> Sentence | None:
        """Return why the name of an adapter is wrong; None: it is not."""

    def traits_of(self, bus: BusConfiguration) -> AdapterTraits | None:
        """Return what is known of the adapter of a bus; None: nothing."""


def check_buses(tree: Tree, adapters: Adapters | None) -> dict[str, BusConfiguration]:
    """Check the ``buses`` of a tree that has passed its schema; return those that can be used."""
    buses: dict[str, BusConfiguration] = {}
    for name, entry in tree.data.get('buses', {}).items():
        path, known = ('buses', name), len(tree.problems)
        values = complete('bus', entry)
        keywords = _check_adapter(tree, path, values, adapters)
        missing = (adapters.missing_keywords(entry['interface'], entry)
                   if keywords is not None and adapters is not None else [])
        if missing:
            tree.wrong(path, complaints.adapter_needs(interface=entry['interface'], keys=missing))
        _check_keys(tree, path, entry, keywords)
        if 'bitrate' not in entry and 'bitrate' in (keywords or ()):
            tree.suspicious(path, complaints.bitrate_assumed(bitrate=values['bitrate']))
        _check_trace_directory(tree, path, values)
        if 'interface' not in entry or 'channel' not in entry:
            continue
        bus = BusConfiguration(name=name, **values, options={
            key: value for key, value in entry.items() if key not in values})
        _look_for_twin(tree, bus, buses, adapters)
        if len(tree.problems) == known:
            buses[name] = bus
    _look_for_channels_of_others(tree, buses.values())
    return buses


def _check_adapter(tree: Tree, path: Path, values: dict[str, Any], adapters: Adapters | None,
                   ) -> set[str] | None:
    """Check what the adapter decides; return the keywords that it accepts, None: unknown."""
    interface = values.get('interface')
    if adapters is None or interface is None:
        return None
    message = adapters.check_interface(interface)
    if message is not None:
        tree.wrong((*path, 'interface'), message)
        return None
    for key, check in (('channel', adapters.check_channel), ('bitrate', adapters.check_bitrate),
                       ('adapter', adapters.check_name)):
        message = check(interface, values[key]) if values.get(key, '') != '' else None
        if message is not None:
            tree.wrong((*path, key), message)
    if interface == 'slcan' and values['bitrate'] in S7_RATES:
        tree.suspicious((*path, 'bitrate'), complaints.rate_of_two())
    return adapters.adapter_keywords(interface)


def _check_keys(tree: Tree, path: Path, entry: dict[str, Any], keywords: set[str] | None) -> None:
    """Report keys that are neither the bridge's nor the adapter's."""
    ours = definition('bus')['properties']
    for key in entry:
        if key in ours or (keywords is not None and key in keywords):
            continue
        slip = nearest(key, ours, cutoff=_SLIP)
        if slip is not None:
            set_by_us = 'not' in ours[slip]
            tree.wrong((*path, key), complaints.unknown_key_of_bridge(word=slip) if set_by_us else
                       complaints.unknown_key(hint=complaints.did_you_mean(word=slip)))
        elif keywords is not None:
            tree.suspicious((*path, key), complaints.adapter_does_not_name(
                interface=entry['interface'], near=hint(key, keywords)))


def _check_trace_directory(tree: Tree, path: Path, values: dict[str, Any]) -> None:
    """Check that the directory of traces can be named, if there will be any."""
    if values['trace_seconds'] > 0.0:
        try:
            pathlib.Path(values['trace_directory']).expanduser()
        except RuntimeError:
            tree.wrong((*path, 'trace_directory'),
                       complaints.no_home(value=values['trace_directory']))


def _look_for_twin(tree: Tree, bus: BusConfiguration, others: dict[str, BusConfiguration],
                   adapters: Adapters | None) -> None:
    """Report an earlier bus at the same place; a serial port can be opened only once."""
    path = ('buses', bus.name, 'channel')
    port = set(adapters.serial_port(bus)) if adapters is not None else set()
    for other in others.values():
        if adapters is not None and not port.isdisjoint(adapters.serial_port(other)):
            tree.wrong(path, complaints.port_of_other_bus(channel=bus.channel, bus=other.name))
            return
        if (bus.interface, str(bus.channel)) == (other.interface, str(other.channel)):
            tree.suspicious(
                path, complaints.channel_of_other_bus(channel=bus.channel, bus=other.name))
            return


def _look_for_channels_of_others(tree: Tree, buses: Iterable[BusConfiguration]) -> None:
    """Warn of a bus that a trace may mean by its name, or another one by its channel."""
    names = {bus.name: bus for bus in buses}
    for other in names.values():
        named = names.get(str(other.channel), other)
        if named is not other:
            tree.suspicious(
                ('buses', named.name), complaints.name_of_other_channel(bus=other.name))


#: share of the bus above which a configuration is refused, and warned about
LOAD_MAX = 1.0
LOAD_WARNING = 0.7


def bus_shares(bus: BusConfiguration, drives: Iterable[DriveConfiguration]) -> dict[str, float]:
    """Return the worst-case share of the bus that the exchange of each of its drives takes."""
    shares: dict[str, float] = {}
    for family, together in _by_family(drives):
        for drive, load in zip(together, family.loads(together)):
            shares[drive.name] = load / bus.bitrate
    return shares


def _by_family(drives: Iterable[DriveConfiguration],
               ) -> Iterator[tuple[Family, list[DriveConfiguration]]]:
    """Yield the drives of one bus, family by family."""
    together: dict[str, list[DriveConfiguration]] = {}
    for drive in drives:
        together.setdefault(drive.protocol, []).append(drive)
    for protocol, members in together.items():
        yield FAMILIES[protocol], members


def check_identifiers(tree: Tree, drives: Iterable[DriveConfiguration],
                      buses: Mapping[str, BusConfiguration]) -> None:
    """
    Report drives that use identifiers of an earlier one on their bus.

    Whatever the names: on a bus that is opened twice, a drive listed twice has two masters.
    """
    claimed: dict[str, list[tuple[Claim, DriveConfiguration]]] = {}
    for drive in drives:
        bus = buses.get(drive.bus)
        on_bus = claimed.setdefault(drive.bus if bus is None else bus.wire, [])
        family = FAMILIES[drive.protocol]
        own = [*family.claims(drive), *family.reserved(drive)]
        hit = next(((mine, claim, other) for mine in own for claim, other in on_bus
                    if mine.overlaps(claim)), None)
        if hit is not None:
            mine, claim, other = hit
            what = claim.purpose if claim.purpose == mine.purpose else \
                f'one identifier, {mine.purpose} here and {claim.purpose} there'
            tree.wrong(
                ('drives', drive.name, 'station'),
                complaints.collides(
                    station=drive.station, other=other.name, other_station=other.station,
                    bus=other.bus, purpose=what))
        rival = next(((claim, other) for mine in own for claim, other in on_bus
                      if other.bus != drive.bus and mine.rivals(claim)), None)
        if rival is not None:
            claim, other = rival
            tree.wrong(('drives', drive.name, 'bus'), complaints.told_by_two_buses(
                bus=drive.bus, other=other.name, other_bus=other.bus, what=claim.shared))
        on_bus.extend((claim, drive) for claim in own)


def check_load(tree: Tree, bus: BusConfiguration, drives: Iterable[DriveConfiguration]) -> None:
    """Check the worst-case load of a bus."""
    shares = bus_shares(bus, drives)
    total = sum(shares.values())
    if total <= LOAD_WARNING:
        return
    parts = ', '.join(f'{name} {100 * share:.1f} %' for name, share in shares.items())
    if total > LOAD_MAX:
        tree.wrong(('buses', bus.name), complaints.overload(
            load=100 * total, bitrate=bus.bitrate, parts=parts, most=100 * LOAD_MAX))
    else:
        tree.suspicious(('buses', bus.name), complaints.high_load(
            load=100 * total, bitrate=bus.bitrate, parts=parts, most=100 * LOAD_WARNING))


def check_rounds(tree: Tree, bus: BusConfiguration, drives: Iterable[DriveConfiguration]) -> None:
    """Report drives whose round of polling does not fit their period."""
    for drive in drives:
        shortest = FAMILIES[drive.protocol].shortest_period(drive, bus.bitrate)
        # rounded up, but not for what binary fractions add: what is named here has to pass
        allowed = math.ceil(shortest * 1e5 - 1e-6) / 1e5
        if drive.period < min(shortest, allowed):
            tree.wrong(
                ('drives', drive.name, 'period'),
                complaints.period_too_short(
                    period=drive.period, bitrate=bus.bitrate, least=allowed))


#: share of a serial line above which it is warned about
LINE_WARNING = 0.7
#: bits of a long frame, its stuffing included: of an exchange that an adapter makes late
_FRAME_BITS = 160


def check_adapter(tree: Tree, bus: BusConfiguration, drives: Sequence[DriveConfiguration],
                  traits: AdapterTraits) -> None:
    """Report what these drives need and an adapter cannot do."""
    path = ('buses', bus.name)
    if bus.options.get(_LISTEN_ONLY):
        instead = traits.listen_only
        tree.suspicious((*path, _LISTEN_ONLY), complaints.only_listens()
                        if instead == f'{_LISTEN_ONLY}: true' else
                        complaints.no_listen_only(adapter=traits.title, instead=instead))
    for drive in drives:
        claims = FAMILIES[drive.protocol].claims(drive)
        dropped = [each.what for each in traits.drops
                   if any(Claim(each.route, '').overlaps(claim) for claim in claims)]
        if dropped:
            tree.wrong((*path, 'adapter' if bus.adapter else 'channel'), complaints.adapter_drops(
                adapter=traits.title, what=dropped, drive=drive.name, protocol=drive.protocol))
    for drive in drives:
        _check_latency(tree, bus, drive, traits)
    if traits.line_rate:
        # about half of it goes either way
        bits = 0.5 * traits.line_bits * bus.bitrate * sum(bus_shares(bus, drives).values())
        share = bits / traits.line_rate
        if share > LINE_WARNING:
            tree.suspicious(path, complaints.line_too_slow(
                adapter=traits.title, rate=traits.line_rate, share=100 * share,
                most=100 * LINE_WARNING))


def _check_latency(tree: Tree, bus: BusConfiguration, drive: DriveConfiguration,
                   traits: AdapterTraits) -> None:
    """Check that a drive's answers come within its period, with the latency of the adapter."""
    family = FAMILIES[drive.protocol]
    # of those that are polled, each answer is waited for before the next question
    exchanges = 1 if family.cyclic else max(1, round(
        family.loads([drive])[0] * drive.period / (2 * _FRAME_BITS)))
    least = exchanges * (traits.latency + 2 * _FRAME_BITS / bus.bitrate)
    if traits.latency and drive.period < least:
        tree.suspicious(('drives', drive.name, 'period'), complaints.adapter_late(
            period=drive.period, adapter=traits.title, latency=f'{1e3 * traits.latency:g}',
            least=math.ceil(least * 1e3) / 1e3, remedy=traits.remedy))


def check_neighbours(tree: Tree, drives: Iterable[DriveConfiguration]) -> None:
    """Report what drives of one bus cannot do together, family by family."""
    for family, together in _by_family(drives):
        for drive, (key, message) in family.check_together(together):
            path = ('drives', drive.name, *(key.split('.') if key else ()))
            if not tree.is_damaged(path):
                tree.wrong(path, message)


#: characters of a topic or service that ROS accepts: 255, without what it puts in front
_TOPIC_MAX = 247
#: the longest name of those that every drive has
_SERVICE = 'set_parameters_atomically'


def check_topics(tree: Tree, drives: Iterable[DriveConfiguration], namespace: str) -> None:
    """
    Report names that are too long together: ROS refuses them in the middle of configuring.

    :param namespace: of the bridge, without the slash at its end.
    """
    for drive in drives:
        topics = [_SERVICE, *(f'command/{parameter.name}' for parameter in drive.cyclic_request)]
        for parameter in drive.cyclic_response:
            topics += [parameter.name, *(f'{parameter.name}/{bit}' for bit, _ in parameter.bits)]
        longest = max(topics, key=len)
        length = len(f'{namespace}/{drive.name}/{longest}')
        if length > _TOPIC_MAX:
            tree.wrong(('drives', drive.name), complaints.topic_too_long(
                topic=f'~/{longest}', length=length, most=_TOPIC_MAX))


def check_joint(tree: Tree, drive: DriveConfiguration) -> JointConfiguration | None:
    """Return the joint of a drive; None where it has none, or a wrong one."""
    entry = tree.data['drives'][drive.name].get('joint')
    return None if entry is None else _JointChecker(tree, drive).check(entry)


def check_joint_names(tree: Tree, drives: Iterable[DriveConfiguration]) -> None:
    """Check that no two drives have joints of one name: they share messages."""
    owners: dict[str, str] = {}
    for drive in drives:
        if drive.joint is not None and owners.setdefault(
                drive.joint.name, drive.name) != drive.name:
            tree.wrong(('drives', drive.name, 'joint', 'name'),
                       complaints.joint_of_other(
                           name=drive.joint.name, owner=owners[drive.joint.name]))


#: s within which a counter that wraps is warned about
_DAY = 86400.0


class _JointChecker:
    """
    Check one ``joint`` section.

    :param drive: the drive as far as it is known; unlisted parameters in its lists stand for
        those that have a problem of their own.
    """

    def __init__(self, tree: Tree, drive: DriveConfiguration) -> None:
        self._tree = tree
        self._drive = drive
        self._path: Path = ('drives', drive.name, 'joint')

    def check(self, entry: dict[str, Any]) -> JointConfiguration | None:
        """Return the joint, or None after noting what is wrong."""
        values = complete('joint', entry)
        named = {key: entry[key] for key in _KEYS if key in entry}
        if not named and not any((*self._path, key) in self._tree.damaged for key in _KEYS):
            self._tree.wrong(self._path, complaints.no_quantity(allowed=', '.join(_KEYS)))
        factors: dict[str, float] = {}
        used: dict[str, str] = {}
        units = set()
        for key, name in named.items():
            parameter = self._find(key, name)
            if parameter is None:
                continue
            quantity = key.removesuffix(_COMMAND)
            if used.setdefault(name, quantity) != quantity:
                self._wrong(key, complaints.quantity_already(name=name, quantity=used[name]))
                continue
            factor = self._factor(key, parameter, values)
            if factor is not None:
                factors[name] = factor
                units.add(parameter.unit)
            if key == 'position_command' and not parameter.neutral_from:
                self._tree.suspicious(
                    (*self._path, key), complaints.no_neutral_from(
                        name=name, unit=parameter.unit,
                        neutral=parameter.value_from_raw(parameter.neutral_raw)))
        if not self._tree.is_sound(self._path):
            return None
        if values['pole_pairs'] != 1 and ELECTRICAL_FREQUENCY not in units:
            self._tree.suspicious(
                (*self._path, 'pole_pairs'),
                complaints.no_effect(unit=ELECTRICAL_FREQUENCY))
        self._check_counter(named, factors, values['continuous'])
        return JointConfiguration(factors=factors, **values)

    def _check_counter(self, named: dict[str, str], factors: dict[str, float],
                       continuous: bool | int) -> None:
        """Check the position where its counter wraps."""
        position, command = named.get('position'), named.get(f'position{_COMMAND}')
        if continuous is not False and position is None:
            self._wrong('continuous', complaints.continuous_without_position())
        if continuous is not False and command is not None:
            self._wrong('continuous', complaints.continuous_commanded(name=command))
        if position is None or command is not None:
            return
        counter = next(each for each in self._drive.cyclic_response if each.name == position)
        steps, most = steps_of(counter, continuous), 1 << counter.type.bits
        if steps > most:
            self._wrong('continuous', complaints.continuous_too_wide(
                steps=steps, bits=counter.type.bits, name=position, most=most))
            return
        setpoint = next((each for each in self._drive.cyclic_request
                         if each.name == named.get(f'velocity{_COMMAND}')), None)
        limits = [] if setpoint is None else [
            abs(limit) for limit in (setpoint.minimum, setpoint.maximum) if limit is not None]
        if setpoint is None or not any(limits):
            return
        speed = max(limits)
        # s that a raw step takes
        step = abs((counter.scale if counter.scaled else 1.0) * factors[position]
                   / (speed * factors[setpoint.name]))
        facts = {'speed': speed, 'unit': setpoint.unit, 'name': position}
        gap = (self._drive.missed_limit + 1) * self._drive.period
        if continuous is False:
            # from the drive's own zero
            after = step * (most // 2 if counter.type.signed else most)
            if after < _DAY:
                self._tree.suspicious((*self._path, 'position'), complaints.position_wraps(
                    after=duration_text(after), **facts))
        elif step * steps / 2 <= gap:
            self._wrong('continuous', complaints.continuous_too_fast(
                steps=steps, passed=duration_text(step * steps / 2), gap=duration_text(gap),
                **facts))

    def _wrong(self, key: str, message: Sentence) -> None:
        self._tree.wrong((*self._path, key), message)

    def _find(self, key: str, name: str) -> Parameter | None:
        """Return the parameter that a key names, if it is good for a joint."""
        listed_in = 'cyclic_request' if key.endswith(_COMMAND) else 'cyclic_response'
        if self._tree.is_damaged((*self._path[:-1], listed_in)):
            return None
        exchanged: dict[str, Parameter] = {
            parameter.name: parameter for parameter in getattr(self._drive, listed_in)}
        parameter = exchanged.get(name)
        if parameter is None:
            misspelt = [other.name for other in exchanged.values() if not other.listed]
            if nearest(name, misspelt, cutoff=0.8):
                return None
            hint = (suggestion(name, exchanged) if exchanged
                    else complaints.list_empty(listed=listed_in))
            self._wrong(key, complaints.not_in_list(name=name, listed=listed_in, hint=hint))
            return None
        if not parameter.listed:
            return None
        control = self._drive.profile.control
        if control is not None and name == control.parameter and key.endswith(_COMMAND):
            self._wrong(key, complaints.control_word(name=name))
            return None
        if parameter.limit and key == f'effort{_COMMAND}':
            self._tree.suspicious((*self._path, key), complaints.joint_bounds(name=name))
        elif parameter.limit and key.endswith(_COMMAND):
            self._wrong(key, complaints.joint_commands_limit(name=name))
            return None
        if parameter.kind is ValueKind.BOOL:
            self._wrong(key, complaints.is_bool(name=name))
            return None
        return parameter

    def _factor(self, key: str, parameter: Parameter, values: dict[str, Any]) -> float | None:
        quantity = JointQuantity(key.removesuffix(_COMMAND))
        factor = si_factor(quantity, parameter.unit, gear_ratio=values['gear_ratio'],
                           pole_pairs=values['pole_pairs'])
        if factor is None:
            unit = f'the unit {show(parameter.unit)}' if parameter.unit else 'no unit'
            self._wrong(key, complaints.does_not_convert(
                name=parameter.name, unit=unit, allowed=', '.join(convertible_units(quantity))))
        return factor


BRIDGE_NAME = 'drive_can_bridge'
_NO_PROFILE = Profile('', '', '', ())
LISTS = ('cyclic_request', 'cyclic_response')
#: keys whose values a drive does not use as they are
_MADE = ('profile', 'protocol', 'rearm', 'joint')

#: s, from which on a period was probably meant in ms
_LONG_PERIOD = 5.0


class DriveChecker:
    """
    Check one drive of a tree that has passed its schema.

    :param buses: names of all buses, wrong ones included.
    """

    def __init__(self, tree: Tree, name: str, buses: list[str], store: ProfileStore) -> None:
        self._tree = tree
        self._name = name
        self._path: Path = ('drives', name)
        self._entry: dict[str, Any] = tree.data['drives'][name]
        self._buses = buses
        self._store = store
        self._loaded: LoadedProfile | None = None

    def check(self) -> DriveConfiguration | None:
        """Return the drive as far as it is known; None where not even the protocol is."""
        if self._name == BRIDGE_NAME:
            self._wrong((), complaints.name_of_bridge(name=self._name))
        bus = self._entry.get('bus')
        if bus is not None and self._buses and bus not in self._buses:
            self._wrong(('bus',), complaints.unknown(name=bus, hint=suggestion(bus, self._buses)))
        family = FAMILIES.get(self._entry.get('protocol', ''))
        self._load_profile(family)
        lists = {key: self._list(key, family) for key in LISTS}
        if family is None:
            return None
        drive = self._build(family, lists)
        self._check_control(family)
        self._check_setpoints(drive)
        self._check_status(drive)
        if not family.cyclic and not drive.cyclic_response and not self._is_damaged(LISTS[1]):
            self._wrong((LISTS[1],), complaints.empty_list(family=family.name))
        if drive.period >= _LONG_PERIOD:
            self._tree.suspicious((*self._path, 'period'), complaints.period_in_seconds(
                period=drive.period, shorter=drive.period / 1000))
        self._place(family.check_widths(drive), Tree.wrong)
        self._place(family.check(drive), Tree.wrong)
        self._place(family.warnings(drive), Tree.suspicious)
        drive = replace(drive, joint=check_joint(self._tree, drive))
        self._look_for_limits(drive)
        return drive

    def is_sound(self, *keys: str) -> bool:
        """Return whether none of these keys has a problem."""
        return all(self._tree.is_sound((*self._path, key)) for key in keys)

    # -- parts ------------------------------------------------------------------------------------

    def _wrong(self, keys: tuple[str, ...], message: Sentence) -> None:
        self._tree.wrong((*self._path, *keys), message)

    def _wrong_entry(self, key: str, position: int, message: Sentence) -> None:
        self._tree.wrong((*self._path, key), message, at=(*self._path, key, position))

    def _is_damaged(self, key: str) -> bool:
        return self._tree.is_damaged((*self._path, key))

    def _load_profile(self, family: Family | None) -> None:
        name = self._entry.get('profile')
        if name is None:
            return
        loaded = self._store.load(name)
        if isinstance(loaded, str):
            self._wrong(('profile',), loaded)
            return
        if loaded.tree.is_damaged(('parameters',)):
            return
        protocols = loaded.profile.protocols
        if family is not None and protocols and family.name not in protocols:
            # nothing of it fits, and nothing is wrong with it
            self._wrong(('profile',), complaints.profile_for_others(
                name=name, protocols=', '.join(protocols), family=family.name))
            return
        self._loaded = loaded

    def _list(self, key: str, family: Family | None) -> tuple[Parameter, ...]:
        """Resolve a list of parameter names; one with a problem becomes an unlisted stand-in."""
        found: list[Parameter] = []
        for position, name in enumerate(self._entry.get(key, [])):
            if any(parameter.name == name for parameter in found):
                self._wrong_entry(key, position, complaints.twice(name=name))
                continue
            parameter = Parameter(name=name, listed=False)
            if self._loaded is not None:
                known = self._loaded.profile.parameters
                if name not in self._loaded.names:
                    fit = [each for each in self._loaded.names if each not in known
                           or not _direction_problem(key, known[each])]
                    hint = suggestion_of_profile(name, fit, self._entry.get('profile', ''))
                    self._wrong_entry(key, position, _built_in(name, family)
                                      or complaints.not_in_profile(name=name, hint=hint))
                parameter = known.get(name, parameter)
            message = _direction_problem(key, parameter)
            if message:
                self._wrong_entry(key, position, message)
            found.append(parameter)
        return tuple(found)

    def _build(self, family: Family, lists: dict[str, tuple[Parameter, ...]],
               ) -> DriveConfiguration:
        values = complete('drive', {
            'bus': '', 'station': 1, **family.drive_defaults, **self._entry, **lists})
        made = {key: values.pop(key, '') for key in _MADE}
        profile = _NO_PROFILE if self._loaded is None else self._loaded.profile
        if family.control_built_in:  # a section for the other protocols of the profile
            profile = replace(profile, control=None)
        given = {key: values[key] for key in family.options_schema if key in self._entry}
        for key in ALL_OPTIONS:
            values.pop(key, None)
        return DriveConfiguration(
            name=self._name, profile=profile, profile_key=made['profile'], protocol=family.name,
            rearm_immediate=made['rearm'] == 'immediate',
            options=family.make_options(values['station'], given), **values)

    def _check_control(self, family: Family) -> None:
        """Check that a control section is not for a family that has its control built in."""
        if not family.control_built_in or self._loaded is None:
            return
        others = [name for name in self._loaded.profile.protocols if name != family.name]
        if self._loaded.profile.control is not None and not others:
            self._loaded.tree.wrong(('control',), complaints.control_built_in(family=family.name))

    def _check_setpoints(self, drive: DriveConfiguration) -> None:
        """Check that what is sent without a command lies in the limits."""
        control = drive.profile.control
        for position, parameter in enumerate(drive.cyclic_request):
            is_word = control is not None and control.parameter == parameter.name
            if parameter.limit and is_word:
                self._wrong_entry('cyclic_request', position, complaints.control_word_limit(
                    name=parameter.name))
            if parameter.neutral_from:
                self._check_held(drive, position, parameter, is_word=is_word)
                continue
            if is_word or not parameter.listed or parameter.neutral is not None:
                continue
            if _direction_problem('cyclic_request', parameter):
                continue
            low, high = parameter.raw_limits
            if not low <= 0 <= high:
                self._wrong_entry('cyclic_request', position, complaints.no_neutral(
                    name=parameter.name, allowed=parameter.range_text))

    def _look_for_limits(self, drive: DriveConfiguration) -> None:
        """Warn of setpoints that look like limits and are not marked: they are 0 until armed."""
        control, joint = drive.profile.control, drive.joint
        no_limits = {None if control is None else control.parameter}
        if joint is not None:
            no_limits |= {joint.position_command, joint.velocity_command, joint.effort_command}
        for position, parameter in enumerate(drive.cyclic_request):
            if (parameter.limit or not parameter.listed or parameter.name in no_limits
                    or not seems_limit(parameter.name, parameter.description)):
                continue
            rest = parameter.neutral_from or show(parameter.value_from_raw(parameter.neutral_raw))
            self._tree.suspicious(
                (*self._path, 'cyclic_request'),
                complaints.looks_like_limit(
                    name=parameter.name, rest=rest, unit=parameter.unit and ' ' + parameter.unit),
                at=(*self._path, 'cyclic_request', position))

    def _check_held(self, drive: DriveConfiguration, position: int, parameter: Parameter, *,
                    is_word: bool) -> None:
        """Check what an axis needs that has to stay where it is (``neutral_from``)."""
        name, measured = parameter.name, parameter.neutral_from
        if is_word:
            self._wrong_entry('cyclic_request', position, complaints.control_word_held(name=name))
        if not self._is_damaged('cyclic_response') and all(
                other.name != parameter.neutral_from for other in drive.cyclic_response):
            self._wrong_entry('cyclic_request', position, complaints.measured_not_listed(
                name=name, measured=measured))
        if drive.rearm_immediate:
            self._wrong(('rearm',), complaints.immediate_jumps(name=name, measured=measured))
        if getattr(drive.options, 'broadcast', 'none') != 'none':
            self._wrong(('broadcast',), complaints.broadcast_held(
                broadcast=drive.options.broadcast, name=name))

    def _check_status(self, drive: DriveConfiguration) -> None:
        control = drive.profile.control
        if control is None or control.status_parameter is None \
                or self._is_damaged('cyclic_response'):
            return
        if all(parameter.name != control.status_parameter for parameter in drive.cyclic_response):
            self._tree.suspicious(
                (*self._path, 'cyclic_response'),
                complaints.status_missing(name=control.status_parameter))

    def _place(self, complaints: Iterator[Complaint],
               note: Callable[[Tree, Path, Sentence], None]) -> None:
        """Record a family's complaints at their places."""
        for key, message in complaints:
            parts = tuple(key.split('.')) if key else ()
            if parts[:1] == ('profile',) and len(parts) > 1 and self._loaded is not None:
                note(self._loaded.tree, parts[1:], message)
            elif not self._tree.is_damaged((*self._path, *parts)):
                note(self._tree, (*self._path, *parts), message)


def _built_in(name: str, family: Family | None) -> Sentence:
    """Return that the family exchanges a name by itself; '' if it does not."""
    if family is None or not family.control_built_in:
        return NOTHING
    plain = _plain(name)
    if plain in map(_plain, family.builtin_names):
        return complaints.status_word_mapped(name=name)
    if plain == _CONTROL_WORD:
        return complaints.mapped_already(name=name, taken=complaints.THE_CONTROL_WORD)
    return NOTHING


def _plain(name: str) -> str:
    """Return a name without differences of spelling between makers: Statusword, status_word."""
    return name.lower().replace('_', '')


def _direction_problem(key: str, parameter: Parameter) -> Sentence:
    """Return why a parameter cannot be exchanged in this direction; '' if it can."""
    if not parameter.listed:
        return NOTHING
    name = parameter.name
    if key == 'cyclic_response':
        return complaints.write_only(
            name=name) if parameter.access is AccessMode.WRITE_ONLY else NOTHING
    if parameter.access is AccessMode.READ_ONLY:
        return complaints.read_only(name=name)
    if parameter.storage is Storage.EEPROM:
        return complaints.kept_in_eeprom(name=name)
    return NOTHING
