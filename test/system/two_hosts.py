# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Two hosts on this machine (root): each has an address, a name and shared memory of its own."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
import os
import shutil
import subprocess

import pytest

#: what a host takes
TOOLS = 'ip', 'mount', 'nsenter', 'unshare'
ADDRESSES = {'a': '10.77.0.1', 'b': '10.77.0.2'}


class Host:
    """
    One of them.

    :param settings: environment variables of what runs there.
    """

    def __init__(self, name: str, settings: Mapping[str, str]) -> None:
        self.name = name
        self._settings = [f'{key}={value}' for key, value in settings.items()]
        self._holder = subprocess.Popen(
            ['unshare', '--net', '--mount', '--uts', 'sh', '-c',
             f'mount -t tmpfs none /dev/shm && hostname host-{name} && echo && exec sleep 100000'],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        assert self._holder.stdout is not None
        self.works = bool(self._holder.stdout.readline())

    @property
    def pid(self) -> int:
        """A process of it."""
        return self._holder.pid

    def command(self, *words: str) -> list[str]:
        """Return a command line that runs there."""
        return ['nsenter', '--target', str(self.pid), '--net', '--mount', '--uts', 'env',
                *self._settings, *words]

    def do(self, line: str) -> None:
        """Run a line of a shell."""
        subprocess.run(self.command('sh', '-c', line), check=True)

    def end(self) -> None:
        """End it, and its end of the wire."""
        self._holder.kill()
        self._holder.communicate()


@contextmanager
def two_hosts(settings: Mapping[str, str]) -> Iterator[Sequence[Host]]:
    """Have hosts *a* and *b*, and a wire between them; skip where that cannot be."""
    if os.geteuid() != 0 or not all(map(shutil.which, TOOLS)):
        pytest.skip(f'takes root, and {", ".join(TOOLS)}')
    hosts = [Host(name, {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', **settings})
             for name in ADDRESSES]
    try:
        if not all(host.works for host in hosts):
            pytest.skip('the kernel gives no name spaces')
        one, two = hosts
        one.do(f'ip link add wire type veth peer name wire netns {two.pid}')
        for host in hosts:
            host.do(f'ip link set lo up && ip link set wire up && '
                    f'ip address add {ADDRESSES[host.name]}/24 dev wire && '
                    'ip route add 224.0.0.0/4 dev wire')
        yield hosts
    finally:
        for host in hosts:
            host.end()
