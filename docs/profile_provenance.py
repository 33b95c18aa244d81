# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How far each entry of the shipped profiles can be trusted, as a page of the documentation.

The page is made from the profiles; a test compares it. To write it anew:
``.venv/bin/python docs/profile_provenance.py``.
"""

from collections.abc import Iterator
from pathlib import Path

from drive_can_bridge.profiles.catalogue import check, Checked, VERIFIED_WORDS
from drive_can_bridge.resources import profiles_directory, share_directory

PAGE = 'profile_trust.md'

_HEAD = """\
# How far the shipped profiles can be trusted

Made from the profiles by `docs/profile_provenance.py`; edit those, not this page.

*Verified* means that address, type, scale and unit of an entry are backed by its source. *Open* is
what of it nothing backs. A verified entry has been compared with what is written somewhere; none
has been compared with a device. [profiles.md](profiles.md) says what the keys mean.
"""


def trust_page(directory: Path) -> str:
    """Return the text of the page for all profiles of a directory that say something of trust."""
    parts = [_HEAD]
    for path in sorted(directory.glob('*.yaml')):
        checked = check(path)
        if checked.count(None) < len(checked.loaded.profile.parameters):
            parts.append('\n'.join(_section(checked)) + '\n')
    return '\n'.join(parts)


def _section(checked: Checked) -> Iterator[str]:
    profile = checked.loaded.profile
    yield f'## {profile.name}'
    yield ''
    yield f'{profile.description}. {len(profile.parameters)} entries, {checked.count(True)} of ' \
          'them verified.'
    yield ''
    yield '| entry | address | verified | open | source |'
    yield '|---|---|---|---|---|'
    for name, entry in checked.entries.items():
        parameter = profile.parameters[name]
        yield f'| `{name}` | {parameter.address} | {VERIFIED_WORDS[parameter.verified]} ' \
              f'| {_cell(entry.get("open", ""))} | {_cell(entry.get("source", ""))} |'
    yield ''
    yield '| source | what it is |'
    yield '|---|---|'
    for key, text in checked.sources.items():
        yield f'| {key} | {_cell(text)} |'


def _cell(text: str) -> str:
    return text.replace('|', '\\|')


def main() -> None:
    """Write the page."""
    target = share_directory() / 'docs' / PAGE
    target.write_text(trust_page(profiles_directory()), encoding='utf-8')


if __name__ == '__main__':
    main()
