# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parameters of drives for people and scripts: directly, or through a running bridge.

.. code-block:: python

    from drive_can_bridge.client import DriveCanError, open_drives

    try:
        with open_drives('robot.yaml') as drives:
            print(drives['conveyor'].read('ramp_time')['ramp_time'].value)
    except DriveCanError as error:
        print(error)

See :mod:`drive_can_bridge.client.drive` for the interface of a drive; both ways to it implement
that: :mod:`.direct`, and :mod:`.bridge`. To a bridge of this host it is the local one
(:mod:`.local`), where that reaches it, else that through ROS (:mod:`.ros_way`).
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from fnmatch import fnmatchcase
from pathlib import Path

from drive_can_bridge.client.drive import (
    Drive, Drives, DriveSource, Enabled, NoDrive, ReadOutcome, WriteOutcome)
from drive_can_bridge.clock import Clock, SteadyClock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import DriveCanError

__all__ = ['Drive', 'DriveCanError', 'Drives', 'Enabled', 'ReadOutcome', 'WriteOutcome',
           'find_source', 'open_drives']


def find_source(params_file: str | Path | None = None, *, namespace: str | None = None,
                nmt_start: bool = False, clock: Clock | None = None,
                slow: Callable[[], AbstractContextManager[object]] = nullcontext) -> DriveSource:
    """
    Return the source of drives, before anything is sent.

    :param params_file: its drives, directly on its buses; None: those of a running bridge.
    :param namespace: of the bridge, where several run.
    :param nmt_start: directly: start CANopen nodes before they are asked.
    :param clock: the clock of all waiting; None: that of this machine.
    :param slow: entered for steps that may take more than a moment.
    :raises ConfigurationError: the file is wrong.
    :raises DriveCanError: the file cannot be read; no bridge is running, or several in different
        namespaces; an argument that does not apply to the way that is used.
    """
    clock = clock or SteadyClock()
    if params_file is not None and namespace is not None:
        raise DriveCanError(sentences.namespace_or_file())
    if params_file is None and nmt_start:
        raise DriveCanError(sentences.nmt_start_alone())
    if params_file is not None:
        from drive_can_bridge.client.direct import DirectSource
        try:
            with slow():
                return DirectSource(params_file, clock, nmt_start=nmt_start)
        except OSError as error:
            raise DriveCanError(sentences.file_unreadable(
                error.filename or params_file, error.strerror or str(error))) from error
    from drive_can_bridge.client.bridge import BridgeSource
    from drive_can_bridge.client.local import local_way
    place = namespace if namespace is None else f'/{namespace.strip("/")}'.rstrip('/')
    way = local_way(place, clock)
    if way is not None:
        return BridgeSource(way)
    with slow():
        from drive_can_bridge.client.ros_way import RosWay
        return BridgeSource(RosWay(place, clock))


def open_drives(params_file: str | Path | None = None, *, only: str | Sequence[str] = ('*',),
                namespace: str | None = None, nmt_start: bool = False) -> Drives:
    """
    Open drives, and return them as a context manager.

    :param only: their names, or shell patterns; one, or several.
    :raises DriveCanError: no drive of such a name, and what :func:`find_source` and
        :meth:`.DriveSource.open` raise.
    """
    source = find_source(params_file, namespace=namespace, nmt_start=nmt_start)
    try:
        names: list[str] = []
        for pattern in [only] if isinstance(only, str) else only:
            found = [name for name in source.names if fnmatchcase(name, pattern)]
            if not found:
                raise NoDrive(pattern, source.names)
            names += found
        drives = source.open(names)
    except BaseException:
        source.close()
        raise
    drives.also_close(source.close)
    return drives
