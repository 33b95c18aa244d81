# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is said, compared by code and fields: wording is the business of the catalogue."""

from typing import Any


class says:  # noqa: N801  reads as a function: assert reason == says('no_answer', attempts=3)
    """
    Equal to each sentence with this code, whose fields include these.

    A field of a sentence may be another ``says``.
    """

    __hash__ = None     # type: ignore[assignment]

    def __init__(self, code: str, **fields: Any) -> None:
        self.code, self.fields = code, fields

    def __eq__(self, other: object) -> bool:
        return getattr(other, 'code', None) == self.code and all(
            name in other.fields and other.fields[name] == value    # type: ignore[attr-defined]
            for name, value in self.fields.items())

    def __repr__(self) -> str:
        fields = ''.join(f', {name}={value!r}' for name, value in self.fields.items())
        return f'says({self.code!r}{fields})'


def status_word(raw: int) -> says:
    """Return what the field ``status`` of a sentence about one drive equals."""
    return says('status_word', raw=raw)


def may_run(why: str, **fields: Any) -> says:
    """Return what the worry about a drive that may still be running equals, by its reason."""
    return says('may_still_be_running', why=says(why, **fields))


def codes(sentences: Any) -> list[str]:
    """Return the codes of sentences, or of events that have one as text or reason."""
    return [getattr(getattr(each, 'text', getattr(each, 'reason', each)), 'code', '')
            for each in sentences]
