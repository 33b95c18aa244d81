# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Puts this directory on the path: every test may import ``builders``.

Takes hypothesis' time limits away: how long an example takes says how busy the machine is.

Gives the test run a ROS domain of its own, before anything of ROS is imported: nothing leaves this
machine, and two test runs on it never meet. The lock ends with the process.
"""

import fcntl
import os
from pathlib import Path
import tempfile

from hypothesis import HealthCheck, settings

settings.register_profile('patient', deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile('patient')

DOMAINS = range(10, 90)


def _own_domain() -> tuple[int, int]:
    """Return a domain that no other test run has, and the descriptor of its lock."""
    folder = Path(tempfile.gettempdir())
    for domain in DOMAINS:
        lock = os.open(folder / f'drive_can_bridge_test_domain_{domain}', os.O_CREAT | os.O_RDWR,
                       0o666)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
        else:
            return domain, lock
    # a file system without locks, or very many runs: any domain will do
    return DOMAINS.start + os.getpid() % len(DOMAINS), -1


_DOMAIN, _LOCK = _own_domain()
os.environ['ROS_DOMAIN_ID'] = str(_DOMAIN)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
