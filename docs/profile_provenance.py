# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How far each entry of the shipped profiles can be trusted, as a page of the documentation.

The page is made from the profiles; a test compares it. To write it again:
``.venv/bin/python docs/profile_provenance.py``.
"""

from collections.abc import Iterator
from pathlib import Path
import re

from drive_can_bridge.profiles.catalogue import check, Checked
from drive_can_bridge.resources import profiles_directory, share_directory

PAGE = 'profile_trust.md'
#: how the entries of each kind are headed, in the order of the page
TITLES: dict[bool | None, str] = {True: 'Verified; open', False: 'Unverified; open',
                                None: 'Not judged; open'}
#: names that are numbered on, without addresses
_RUN = re.compile(r'`([a-z_0-9]+)_(\d+)`(?:, `\1_\d+`)+, `\1_(\d+)`')

_HEAD = """\
# How far the shipped profiles can be trusted

What of each entry is open, because no document backs it, and in brackets which documents back the
rest (the profile says which back each entry by itself, and names them in full). *Verified*:
documents back address, type, scale and unit. *Unverified*: look up in the drive's manual what is
open before you rely on it. No profile has been compared with a device.

Made by `docs/profile_provenance.py`; edit the profiles ([keys](profiles.md)).
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
          f'them verified. [Documents](../config/profiles/{profile.name}.yaml)'
    for verified, title in TITLES.items():
        if groups := _groups(checked, verified):
            yield from ('', f'### {title}', '')
            for still_open, (names, sources) in groups.items():
                named = _RUN.sub(r'`\1_\2` to `\1_\3`', ', '.join(names))
                backed_by = ', '.join(sources) or 'no document'
                yield f'* {named}: {still_open} ({backed_by})' if still_open \
                    else f'* {named}: nothing'


def _groups(checked: Checked, verified: bool | None) -> dict[str, tuple[list[str], list[str]]]:
    """Return entries and sources by what is open of them."""
    groups: dict[str, tuple[list[str], list[str]]] = {}
    for name, entry in checked.entries.items():
        parameter = checked.loaded.profile.parameters[name]
        if parameter.verified is not verified:
            continue
        names, sources = groups.setdefault(entry.get('open', ''), ([], []))
        # what is verified has its address in the profile; the other one is to be compared
        address = '' if verified or parameter.number is parameter.index is None else (
            f' {parameter.address}')
        names.append(f'`{name}`{address}')
        # which of them backs what stands in the profile, in brackets
        backed_by = re.sub(r' \([^)]*\)', '', entry.get('source', ''))
        sources += [each for each in backed_by.split(', ') if each and each not in sources]
    return groups


def main() -> None:
    """Write the page."""
    target = share_directory() / 'docs' / PAGE
    target.write_text(trust_page(profiles_directory()), encoding='utf-8')


if __name__ == '__main__':
    main()
