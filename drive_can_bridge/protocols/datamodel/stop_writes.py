# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Stop a drive by acyclic writes of ``disable`` and neutral by number, which no map can misroute.

The writes go at once, whatever is under way and wherever the drive keeps the values. Nobody
acknowledges them, so each is read back, and written again where it is not what it should be.
"""

from collections.abc import Generator, Sequence
from typing import NamedTuple

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.datamodel.channel import Read, Step, Words, Write

#: how often everything is written at most
ATTEMPTS = 3
#: s that an answer is waited for at most
ANSWER_TIME = 0.1


class StopWrite(NamedTuple):
    """What makes a drive stand still."""

    parameter: Parameter
    write: Write

    @property
    def name(self) -> str:
        """What is written, for people."""
        return f'{self.parameter.name} ({self.parameter.address})'


def confirm(writes: Sequence[StopWrite], timeout: float,
            ) -> Generator[Step, Words | None, list[str]]:
    """Read back what was written, and write it again as needed; return what failed, in words."""
    blind = [each for each in writes if not each.parameter.readable]
    wrong = [each for each in writes if each.parameter.readable]
    failed: list[str] = []
    for attempt in range(ATTEMPTS):
        for each in (*blind, *wrong) if attempt else ():
            yield each.write
        doubtful, failed, silent = wrong, [], False
        wrong = []
        for each in doubtful:
            reply = None if silent else (yield Read(
                each.write.number, attempts=1, late_will_do=True, timeout=timeout))
            silent = reply is None
            if reply is None:
                failed.append(f'{each.name}: no answer')
            elif reply[0] != each.write.words[0]:
                failed.append(f'{each.name}: read back {reply[0]} instead of '
                              f'{each.write.words[0]}')
            else:
                continue
            wrong.append(each)
        if not wrong and not blind:
            break
    return failed
