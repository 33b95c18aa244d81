# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Whether the objects exist that PDOs are to carry.

Some stacks acknowledge the mapping of an object that they lack, and read it back: what is sent by
it has no effect then (Lely core 2.4.0, CanFestival 3). So each object is read before anything is
mapped. Only the drive's own word counts: that it has none (06020000h, 06090011h), or, of a drive
that tells the size of its status word as it is, another size than the profile has.
"""

from collections.abc import Iterable

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import Sentence, together
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.cia402 import pdo
from drive_can_bridge.protocols.cia402.objects import at_object, differs, ObjectAccess
from drive_can_bridge.protocols.cia402.pdo import Pdo
from drive_can_bridge.protocols.cia402.transactor import ObjectRead, Procedure, Reply, Transfer
from drive_can_bridge.protocols.transactor import Refused


def named(parameter: Parameter) -> str:
    """Return name and object of a parameter: ``torque_limit (6072h.00h)``."""
    return f'{parameter.name} ({at_object(parameter.index or 0, parameter.subindex or 0)})'


def read_mapped(objects: ObjectAccess, pdos: Iterable[Pdo], status: Reply,
                ) -> Procedure[dict[Parameter, int]]:
    """
    Read all that PDOs are to carry.

    :param status: how the drive answers the read of its status word.
    :return: what was read, as words.
    :raises End: nobody answers, or something does not exist.
    """
    wanted = {(each.index or 0, each.subindex or 0): each for one in pdos
              for each in one.parameters}
    # sizes mean something
    judged = isinstance(status, ObjectRead) and status.padded is False
    found: dict[Parameter, int] = {}
    missing: list[Sentence] = []
    for place, parameter in wanted.items():
        reply = yield from objects.transfer(Transfer(*place))
        length = pdo.width(parameter)
        if isinstance(reply, Refused) and reply.absent:
            missing.append(sentences.of_object(named(parameter), sentences.no_such_object()))
        elif isinstance(reply, Refused):
            continue
        elif judged and reply.sized and len(reply.content) != length:
            missing.append(sentences.of_object(named(parameter), sentences.other_length(
                len(reply.content), parameter.type.value)))
        else:
            found[parameter] = reply.number(length)
    if missing:
        raise differs(together(missing))
    return found
