# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""README and documents: ``drive_can`` understands their commands, and their links lead on."""

from pathlib import Path
import re
import shlex

import pytest

import drive_can_bridge
from drive_can_bridge.cli import main as front_end

ROOT = Path(drive_can_bridge.__file__).resolve().parents[1]
#: at the beginning of a line, behind a prompt, or between backticks; with a colon a command speaks
COMMAND = re.compile(r'(?:^(?:\$ )?|`)drive_can ([a-z][a-z-]*(?![a-z:-])[^`\n]*)', re.MULTILINE)
#: what follows is for the shell
END = re.compile(r'\s[|>&]')


def shown(text: str) -> list[str]:
    """Return the commands of a text; a bare name, or one that is left open, is only mentioned."""
    commands = [END.split(each)[0].strip() for each in COMMAND.findall(text)]
    return [each for each in commands if not re.search(r'[…\[]', each) and re.search(
        r'\s[^-\s]', each.removeprefix('profile '))]


PAGES = {page: commands for page in [ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))]
         if (commands := shown(page.read_text(encoding='utf-8')))}


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_commands_are_understood(page: Path) -> None:
    for command in PAGES[page]:
        try:
            front_end.understood(shlex.split(command, comments=True))
        except SystemExit as end:
            assert end.code == 0, command


def test_commands_are_found() -> None:
    assert sum(map(len, PAGES.values())) > 40
    page = ('$ drive_can record -o a.log | x\n`drive_can decode …` `drive_can scan`\n'
            '`drive_can scan: bus down`\n')
    assert [command.split() for command in shown(page)] == [['record', '-o', 'a.log']]


#: of links: everything but addresses of other hosts
LINK = re.compile(r'\]\((?!https?:)([^)\s]+)\)')
TEXTS = {page: page.read_text(encoding='utf-8') for page in [
    *ROOT.glob('*.md'), *(ROOT / 'docs').glob('*.md'), *(ROOT / 'bench').glob('*.md')]}


def anchors(text: str) -> set[str]:
    """Return what links to a page may name: its headings, as GitHub writes them, and its ids."""
    headings = re.findall('^#+ (.*)$', re.sub('```.*?```', '', text, flags=re.DOTALL),
                          re.MULTILINE)
    return {re.sub(r'[^\w -]', '', heading.lower()).replace(' ', '-') for heading in headings} | {
        *re.findall('id="(.*?)"', text)}


@pytest.mark.parametrize('page', TEXTS, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    wrong = []
    for link in LINK.findall(TEXTS[page]):
        name, _, anchor = link.partition('#')
        target = (page.parent / name).resolve() if name else page
        if not target.exists() or anchor and anchor not in anchors(TEXTS[target]):
            wrong.append(link)
    assert wrong == []


def test_the_index_has_every_page() -> None:
    index = ROOT / 'docs' / 'README.md'
    named = {(index.parent / link.partition('#')[0]).resolve()
             for link in LINK.findall(TEXTS[index])}
    assert {*(ROOT / 'docs').glob('*.md')} - {index} <= named
