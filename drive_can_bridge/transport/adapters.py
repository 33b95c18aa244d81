# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What python-can knows about its adapters, without opening one.

Used by the configuration check: an interface that does not exist or lacks its driver will never
work, and a key that the adapter's class does not name is probably misspelt. Most classes swallow
unknown keywords silently.
"""

from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
import importlib
import inspect
import logging
import re
from typing import Any

import can
import can.interfaces

from drive_can_bridge.core import complaints
from drive_can_bridge.core.complaints import suggestion
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.transport.bus_identity import identity_of, SERIAL_INTERFACES
from drive_can_bridge.transport.known_adapters import (
    BY_NAME, traits_of as traits_of, what_helps)
from drive_can_bridge.transport.serial_writer import MORE_RATES

#: how a channel begins that pyserial opens, but is no device here; others may write files
_REMOTE = ('socket://', 'rfc2217://')


def adapter_keywords(interface: str) -> set[str] | None:
    """
    Return the keyword arguments that an adapter's class, or one it inherits from, names.

    :return: None where the class cannot be imported: then nothing is known.
    """
    try:
        adapter = _adapter_class(interface)
    except _Unusable:
        return None
    names: set[str] = set()
    for ancestor in inspect.getmro(adapter):
        if '__init__' not in vars(ancestor) or ancestor is object:
            continue
        try:
            parameters = inspect.signature(vars(ancestor)['__init__']).parameters
        except (TypeError, ValueError):
            return None
        names.update(name for name, parameter in parameters.items() if parameter.kind in (
            inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY))
    return names - {'self'}


def missing_keywords(interface: str, given: Container[str]) -> list[str]:
    """Return the required keys of an adapter's class that are missing."""
    try:
        parameters = inspect.signature(_adapter_class(interface)).parameters.values()
    except (_Unusable, TypeError, ValueError):
        return []
    return [each.name for each in parameters
            if each.default is each.empty and each.name not in given and each.name != 'channel'
            and each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]


def check_interface(interface: str) -> Sentence | None:
    """Return why an interface can never be used on this machine; None: it may."""
    known = sorted(can.interfaces.BACKENDS)
    if interface not in can.interfaces.BACKENDS:
        if re.fullmatch(r'v?s?l?can[0-9]+', interface):
            return complaints.channel_of_kernel(name=interface)
        if interface.startswith('/dev/'):
            return complaints.channel_of_serial(name=interface)
        helps = what_helps(interface)
        if helps:
            return complaints.driver_missing(
                interface=interface, why='a plug-in of python-can', helps=helps)
        return complaints.no_interface(name=interface, hint=suggestion(interface, known))
    try:
        adapter = _adapter_class(interface)
    except _Unusable as error:
        return complaints.driver_missing(
            interface=interface, why=str(error), helps=what_helps(interface))
    # python-can's serial adapters import without pyserial, and fail only when they are opened.
    if getattr(inspect.getmodule(adapter), 'serial', adapter) is None:
        return complaints.driver_missing(
            interface=interface, why='Python module pyserial', helps=what_helps(interface))
    return None


def check_channel(interface: str, channel: str | int) -> Sentence | None:
    """Return why a channel is impossible for an interface; None: it may be possible."""
    if interface not in SERIAL_INTERFACES:
        return None
    text = str(channel)
    if isinstance(channel, str) and ('://' not in text or text.lower().startswith(_REMOTE)):
        return None
    return complaints.no_serial_port(channel=channel)


def check_bitrate(interface: str, bitrate: int) -> Sentence | None:
    """
    Return why an adapter cannot be set to a bit rate; None: it may be possible.

    Known for adapters whose class has a closed table of bit rates (slcan). The others report it
    when they are opened.
    """
    try:
        rates = getattr(_adapter_class(interface), '_BITRATES', None)
    except _Unusable:
        return None
    if not isinstance(rates, dict) or not rates:
        return None
    rates = {**rates, **MORE_RATES.get(interface, {})}
    if bitrate in rates:
        return None
    return complaints.no_bitrate(
        bitrate=bitrate, interface=interface,
        allowed=', '.join(str(rate) for rate in sorted(rates)))


def check_name(interface: str, name: str) -> Sentence | None:
    """Return why the name of an adapter is wrong; None: it is not."""
    row = BY_NAME.get(name)
    if row is None:
        fitting = [each.name for each in BY_NAME.values() if each.interface == interface]
        return complaints.unknown_adapter(name=name, hint=suggestion(name, fitting or BY_NAME))
    if row.interface != interface:
        return complaints.adapter_of_other_interface(name=name, other=row.interface)
    return None


def serial_port(bus: BusConfiguration) -> tuple[str, ...]:
    """Return what the serial port of a bus is known by on this host; empty: there is none."""
    identity = identity_of(bus)
    return identity.names if identity.port else ()


def detected(interface: str) -> list[Mapping[str, Any]]:
    """
    Return the devices that an interface finds on this host, as python-can describes them.

    :raises Exception: whatever its library throws.
    """
    try:
        return list(_adapter_class(interface)._detect_available_configs())
    except (_Unusable, NotImplementedError):
        return []


class _Unusable(Exception):
    """The class of an adapter cannot be imported."""


def _adapter_class(interface: str) -> type[Any]:
    try:
        module, name = can.interfaces.BACKENDS[interface]
        with quiet():
            adapter: type[Any] = getattr(importlib.import_module(module), name)
    except Exception as error:  # adapters, plugins among them, raise anything here
        raise _Unusable(error) from error
    return adapter


@contextmanager
def quiet() -> Iterator[None]:
    """Keep adapters from logging about optional libraries while they are only looked at."""
    logger = logging.getLogger('can')
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(level)
