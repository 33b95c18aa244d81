# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whatever a file holds: a profile that passes its check, or one line that says why not."""

import contextlib
import io
from pathlib import Path
import tempfile

from extent import times
from hypothesis import example, given, settings, strategies as st
import pytest

from drive_can_bridge.cli.main import main
from drive_can_bridge.profiles.catalogue import check

CELLS = st.one_of(
    st.sampled_from(['Nr', 'Name', 'Index', 'Subindex', 'Einheit', 'Min', 'Max', 'Typ', 'Zugriff',
                     'Bits', 'Scale', 'Offset', 'Bereich', 'Nachkommastellen', 'Parameter']),
    st.sampled_from(['1', '2', 'P102', '102.1', '0x2004', '2004h', 'P613[-05]', '0,5', '1.000',
                     '-5', '1e300', '0x', 'h', '1/0', '10^-99', '0..5', 'rw', 'WORD', 'DINT',
                     'bool', 's', '1/min', '°C', '0=a;1=b', 'online', "'", '"', '#', '{', '\\',
                     '\x85', '\u2028', '\ud7ff', '９', '²', '٣', 'ﬁ', 'ẞ', 'İ', '1' * 30,
                     '99999999h', '[-0]', '[-999]', '-', '=', ',']),
    st.text(max_size=12))
TABLES = st.builds(
    lambda sign, rows: '\n'.join(sign.join(row) for row in rows),
    st.sampled_from([';', ',', '\t', '|']), st.lists(st.lists(CELLS, max_size=8), max_size=8))


def run(content: bytes, suffix: str, *options: str) -> None:
    """Import a file as a user does."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, f'any{suffix}'), Path(folder, 'made.yaml')
        source.write_bytes(content)
        said, complained = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
            code = main(['profile', 'import', str(source), '-o', str(target), *options])
        text = complained.getvalue()
        assert 'internal error' not in text and 'Traceback' not in text, text
        assert code in (0, 1)
        assert target.exists() is (code == 0)
        if code == 0:
            checked = check(target)
            assert [str(each) for each in (*checked.problems, *checked.warnings)] == []
            assert checked.loaded.profile.parameters
        else:
            assert len(text.splitlines()) == 1


@given(TABLES)
@settings(deadline=None, max_examples=times(30, 300))
@example('Nr;Name;Min;Max\n1;a;1e300;-1e300')
@example('Nr;Typ;Scale;Offset\n1;int32;1e15;1e15')
@example('Nr;Name;Scale\n1;a;0.0000000000001')
@example('Nr;Bits\n1;99=a')
@example('Nr;Bits\n1;5=a\n')
@example('Nr;Name\n1;p1\n2;P1\n3;p1_value')
@example('Index;Subindex;Name\n2004;300;a\n2004;0A;b')
def test_any_table(table: str) -> None:
    run(table.encode('utf-8', 'surrogatepass'), '.csv')


@given(st.binary(max_size=300))
@settings(deadline=None)
def test_any_bytes(content: bytes) -> None:
    run(content, '.csv')
    run(b'Nr;Name;Unit\n1;' + content, '.csv')


@given(st.lists(st.one_of(
    st.sampled_from(['[2000]', '[2000sub1]', '[2000Name]', '[A0]', '[A0sub1]', '[DeviceInfo]',
                     'ParameterName=a', 'DataType=0x0006', 'DataType=0x00A0', 'DataType=7',
                     'AccessType=rw', 'ObjectType=0x9', 'ObjectType=8', 'ObjectType=0x2',
                     'LowLimit=$NODEID+5', 'HighLimit=-1', 'CompactSubObj=3', 'SubNumber=-5',
                     'NrOfEntries=2', '1=x', 'Factor=nan', 'Factor=1e999', 'Factor=0',
                     'DefaultValue=6', 'Unit=%', '[2001]', 'NrOfEntries=%d', '[DummyUsage]',
                     'Dummy0001=1', '[Comments]', 'Lines=x']),
    st.text(max_size=15)), max_size=25))
@settings(deadline=None, max_examples=times(30, 300))
@example(['[2000]', 'ParameterName=a', 'DataType=3', 'AccessType=rw', 'Factor=nan'])
@example(['[2000]', 'ParameterName=a', 'DataType=3', 'AccessType=rw', 'Factor=1e999',
          'LowLimit=1'])
def test_any_eds(rows: list[str]) -> None:
    pytest.importorskip('canopen')
    run('\n'.join(rows).encode('utf-8', 'surrogatepass'), '.eds')
