# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Stop a drive by acyclic writes of ``disable`` and neutral by number, which no map can misroute.

The writes go at once, whatever is under way and wherever the drive keeps the values. Nobody
acknowledges them, so each is read back, and written again where it is not what it should be.
"""

from collections.abc import Generator, Sequence

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.datamodel.channel import Read, Step, Words, Write

#: how often everything is written at most
ATTEMPTS = 3
#: s that an answer is waited for at most
ANSWER_TIME = 0.1


def confirm(writes: Sequence[tuple[Parameter, Write]], timeout: float,
            ) -> Generator[Step, Words | None, list[str]]:
    """Read back what was written, and write it again as needed; return what failed, in words."""
    blind = [each for each in writes if not each[0].readable]
    wrong = [each for each in writes if each[0].readable]
    failed: list[str] = []
    for attempt in range(ATTEMPTS):
        for each in (*blind, *wrong) if attempt else ():
            yield each[1]
        doubtful, failed, silent = wrong, [], False
        wrong = []
        for parameter, write in doubtful:
            reply = None if silent else (yield Read(
                write.number, attempts=1, late_will_do=True, timeout=timeout))
            silent = reply is None
            if reply == write.words:
                continue
            wrong.append((parameter, write))
            failed.append(f'{parameter.name} ({parameter.address}): ' + (
                'no answer' if reply is None else
                f'read back {reply[0]} instead of {write.words[0]}'))
        if not wrong and not blind:
            break
    return failed
