# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The whole catalogue: all rows of all its modules, by what they are about and by their codes."""

from types import ModuleType

from drive_can_bridge.core import (
    bus_sentences, command_sentences, complaints, frame_sentences, host_sentences, messages,
    sentences, state_names)
from drive_can_bridge.core.messages import Sentence, Text

#: the modules of rows, by what they are about; a code stands once, and may be one of files, too
MODULES: dict[str, tuple[ModuleType, ...]] = {
    'drives and buses': (sentences, bus_sentences, frame_sentences, host_sentences),
    'commands': (command_sentences,),
    'states': (state_names,),
    'files': (complaints,),
}
CODES: dict[str, dict[str, Text]] = {
    about: {code: row for module in modules for code, row in module.CODES.items()}
    for about, modules in MODULES.items()}
#: rows that a text may be of which came through ROS
_SAID = [row for about, rows in CODES.items() if about not in ('files', 'states')
         for row in rows.values()]


def code_of(text: str) -> str:
    """Return the code of a text for people, also where it came through ROS; '': it has none."""
    if isinstance(text, Sentence) and text.code and text.row is not sentences.uncoded:
        return text.code
    return messages.code_of(text, _SAID) if text else ''


def make_ready() -> None:
    """Prepare all texts now: some are written when no memory is left."""
    for rows in CODES.values():
        for row in rows.values():
            row.make_ready()
