# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What is said behind values that were written, by families whose drives do not keep them.

Apart from the families, so that to say it takes no longer than to write.
"""

from typing import NamedTuple


class Storing(NamedTuple):
    """
    How a drive is made to store what was written.

    :ivar text: what becomes of it without, up to the command.
    :ivar word: what is written then, behind ``drive_can write DRIVE``.
    """

    text: str
    word: str


#: by the name of the family; the drives of all others are told by each parameter
STORING = {
    'cia402': Storing('not stored: lost at power-off; to store all of it: ',
                      'x1010.1=0x65766173'),
}
