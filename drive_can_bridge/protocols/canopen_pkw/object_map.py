# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Where the registers of a TeSys T LTMR stand in its CANopen object dictionary.

Source: the register overview of the LTMR CANopen guide, which prints the first and last address
of each group (statistics 2001h.01h, monitoring 2004h.01h = register 450, command 2008h.01h to
.64h = 700 to 799, …). Inside a group, sub-index 1 is the first register. That 2000h and 2003h
begin at 0 and 300 follows from their last registers (96 and 429), which another overview of the
vendor names. The two other rows are *interpolated*: they follow from their neighbours.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Block:
    """
    The registers of one index: ``first`` has sub-index 1.

    :param certain: printed by the vendor, or follows from what is; False: interpolated.
    """

    index: int
    first: int
    last: int
    certain: bool


BLOCKS = (
    Block(0x2000, 0, 99, True),        # identification
    Block(0x2001, 100, 199, True),     # statistics
    Block(0x2002, 200, 299, False),
    Block(0x2003, 300, 449, True),
    Block(0x2004, 450, 539, True),     # monitoring
    Block(0x2005, 540, 599, True),     # configuration
    Block(0x2006, 600, 649, False),
    Block(0x2007, 650, 699, True),
    Block(0x2008, 700, 799, True),     # command
    Block(0x200C, 1200, 1299, True),   # custom logic
    Block(0x200D, 1300, 1399, True),
)


def object_of(register: int) -> tuple[int, int] | None:
    """
    Return index and sub-index of a register; None: it has none.

    >>> '%04X.%02X' % object_of(465)
    '2004.10'
    """
    for block in BLOCKS:
        if block.first <= register <= block.last:
            return block.index, register - block.first + 1
    return None


def register_of(index: int, subindex: int) -> int | None:
    """Return the register at an index and sub-index; None: there is none."""
    for block in BLOCKS:
        if block.index == index and 1 <= subindex <= block.last - block.first + 1:
            return block.first + subindex - 1
    return None
