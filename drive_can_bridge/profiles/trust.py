# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How far each entry of the shipped profiles can be trusted, as a page of the documentation.

The page is made from the profiles; a test compares it. To write it anew:
``python3 -m drive_can_bridge.profiles.trust``.
"""

from collections.abc import Iterator
from pathlib import Path

from drive_can_bridge.profiles.catalogue import check, Checked
from drive_can_bridge.resources import profiles_directory, share_directory

PAGE = 'profile_trust.md'
#: how an entry's key ``verified`` is shown
TRUST_WORDS: dict[bool | None, str] = {True: 'yes', False: 'no', None: ''}
#: and how the entries of each kind are headed, in the order of the page
TITLES: dict[bool | None, str] = {True: 'verified', False: 'not verified', None: 'not judged'}

_HEAD = """\
# How far the shipped profiles can be trusted

Which entries of the shipped profiles are backed by a document, and by which. *Verified*: address,
type, scale and unit are. *Open*: what nothing backs. None has been compared with a device. What
has no number is in process data only.

Made by `python3 -m drive_can_bridge.profiles.trust`; edit the profiles ([keys](profiles.md)).
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
    for verified, title in TITLES.items():
        if rows := _rows(checked, verified):
            yield f'| {title} | open | source |'
            yield '|---|---|---|'
            for row, names in rows.items():
                yield f'| {", ".join(names)} | {" | ".join(row)} |'
            yield ''
    for key, text in checked.sources.items():
        yield f'* **{key}**: {text}'


def _rows(checked: Checked, verified: bool | None) -> dict[tuple[str, ...], list[str]]:
    """Return the entries, with their addresses, by what is open of them and their sources."""
    rows: dict[tuple[str, ...], list[str]] = {}
    for name, entry in checked.entries.items():
        parameter = checked.loaded.profile.parameters[name]
        if parameter.verified is not verified:
            continue
        row = _cell(entry.get('open', '')), _cell(entry.get('source', ''))
        address = '' if parameter.number is parameter.index is None else f' {parameter.address}'
        rows.setdefault(row, []).append(f'`{name}`{address}')
    return rows


def _cell(text: str) -> str:
    return text.replace('|', '\\|')


def main() -> None:
    """Write the page."""
    target = share_directory() / 'docs' / PAGE
    target.write_text(trust_page(profiles_directory()), encoding='utf-8')


if __name__ == '__main__':
    main()
