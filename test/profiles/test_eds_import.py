# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""EDS files, good ones and others, through the library canopen."""

import builtins
from pathlib import Path
from typing import Any

from import_builders import bring_in, Outcome, told
import pytest
from transcripts import stories

from drive_can_bridge.core.parameters import AccessMode, Parameter, ParameterType, Storage
from drive_can_bridge.profiles.catalogue import ImportFailed

TOLD = stories(__file__, 'imports.yaml')
EDS = """\
[FileInfo]
FileName=small.eds
[DeviceInfo]
VendorName=Müller & Söhne
ProductName=Drive 3000
[Comments]
Lines=1
Line1=anything = at all
[MandatoryObjects]
SupportedObjects=2
1=0x1000
2=0x1018
[1000]
ParameterName=Device type
DataType=0x0007
AccessType=ro
[1017]
ParameterName=Producer heartbeat time
ObjectType=0x7
DataType=0x0006
AccessType=rw
DefaultValue=nonsense
[1018]
ParameterName=Identity object
ObjectType=0x9
SubNumber=2
[1018sub0]
ParameterName=Highest sub-index
DataType=0x0005
AccessType=ro
[1018Sub1]
ParameterName=Vendor-ID
DataType=0x0007
AccessType=ro
[2000]
ParameterName=Ramp time
DataType=0x0006            ; UNSIGNED16
AccessType=rww
LowLimit=1
HighLimit=0x1770
StorageLocation=PERSIST_COMM
Factor=0.01
Unit=s
Description=From standstill to maximum speed
[2001]
ParameterName=Speed setpoint
DataType=0x0003
AccessType=rw
LowLimit=0x8AD0
HighLimit=30000
StorageLocation=RAM
Factor=0.1
Unit=1/min
[2002]
ParameterName=Flag
DataType=0x0001
AccessType=rw
[2003]
ParameterName=Name of the drive
DataType=0x0009
AccessType=ro
[2010]
ParameterName=Temperatures
ObjectType=0x8
DataType=0x0003
AccessType=ro
CompactSubObj=2
[2010Name]
NrOfEntries=1
1=Motor
[2020]
ParameterName=Mode
DataType=0x00A0
AccessType=rw
[A0]
ParameterName=ours
[A0sub1]
ParameterName=type
DataType=0x0005
AccessType=ro
DefaultValue=0x0006
"""
DRIVE = 'Müller & Söhne Drive 3000'
RAMP_TIME = Parameter(
    'ramp_time', index=0x2000, subindex=0, scale=0.01, unit='s', scaled=True,
    storage=Storage.EEPROM, minimum=0.01, maximum=60.0,
    description='Ramp time; From standstill to maximum speed')


@pytest.fixture(autouse=True)
def library() -> None:
    """Skip where the library is not installed."""
    pytest.importorskip('canopen')


def bring(folder: Path, old: str = '', new: str = '', name: str = 'small.eds') -> Outcome:
    if old not in EDS:
        raise ValueError(f'{old!r} is not in the file')
    return bring_in(folder, EDS.replace(old, new, 1) if old else EDS, name)


def test_everything_that_an_entry_can_have(tmp_path: Path) -> None:
    made = bring(tmp_path)
    assert made.profile.description == DRIVE
    assert made.profile.protocols == ('canopen_pkw',)
    assert made.profile.identity == ('vendor_id',)
    assert list(made.parameters) == [
        'device_type', 'producer_heartbeat_time', 'vendor_id', 'ramp_time',
        'speed_setpoint', 'flag', 'motor', 'temperatures_2', 'mode']
    assert made.parameters['ramp_time'] == RAMP_TIME
    assert made.parameters['speed_setpoint'] == Parameter(
        'speed_setpoint', ParameterType.INT16, index=0x2001, subindex=0, scale=0.1, unit='rpm',
        scaled=True, storage=Storage.RAM, minimum=-3000.0, maximum=3000.0,
        description='Speed setpoint')
    assert made.parameters['flag'].type is ParameterType.BOOL
    assert made.parameters['temperatures_2'] == Parameter(
        'temperatures_2', ParameterType.INT16, index=0x2010, subindex=2,
        access=AccessMode.READ_ONLY, description='Temperatures_2')
    assert made.parameters['mode'].type is ParameterType.UINT16
    assert [name for name, each in made.parameters.items() if each.protected] == [
        'producer_heartbeat_time']
    assert told(made) == TOLD['small.eds']


def test_dcf_and_other_names(tmp_path: Path) -> None:
    for name in ('small.dcf', 'SMALL.EDS', 'small.txt'):
        assert len(bring(tmp_path, name=name).parameters) == 9


@pytest.mark.parametrize(('old', 'new', 'lost', 'place', 'reason'), [
    # bad numbers
    ('DataType=0x0007', 'DataType=0xZZ', 'device_type', '[1000]', "DataType '0xZZ' is no number"),
    ('DataType=0x0003', 'DataType=', 'speed_setpoint', '[2001]', 'DataType is empty'),
    ('DataType=0x0007', 'DataType=010', 'device_type', '[1000]',
     "DataType '010' may be 10 or, octal, 8"),
    ('DataType=0x0003', 'DataType=0x0100', 'speed_setpoint', '[2001]',
     'data type 0100h is none of the types of 16 or 32 bits'),
    ('CompactSubObj=2', 'CompactSubObj=x', 'motor', '[2010]', "CompactSubObj 'x' is no number"),
    ('CompactSubObj=2', 'CompactSubObj=999', 'motor', '[2010]',
     'CompactSubObj 999 is out of range'),
    ('CompactSubObj=2', '', 'motor', '[2010]', 'has no sub-indices in the file'),
    # missing keys and sections
    ('DataType=0x0006            ; UNSIGNED16\n', '', 'ramp_time', '[2000]',
     'DataType is missing'),
    ('[1000]', '[10000]', 'device_type', '[MandatoryObjects]', 'section [1000] is missing'),
    ('[1000]', '[0002]', 'device_type', '[0002]',
     'describes a type of data, and is no object'),
    ('[1000]', '[1000subject]', 'device_type', '[1000subject]', 'is no section of an object'),
])
def test_a_broken_section_costs_that_entry_only(tmp_path: Path, old: str, new: str, lost: str,
                                                place: str, reason: str) -> None:
    good = set(bring(tmp_path).parameters)
    made = bring(tmp_path, old, new)
    assert lost in good - set(made.parameters)
    assert len(good - set(made.parameters)) <= 2
    assert any(place in line and reason in line for line in made.left_out), made.left_out
    assert all(int(line.split(':')[0]) <= EDS.count('\n') for line in made.left_out)


@pytest.mark.parametrize(('old', 'new', 'remark'), [
    ('ObjectType=0x7', 'ObjectType=seven', ''),
    ('ObjectType=0x9', 'ObjectType=nine', ''),
    ('DefaultValue=nonsense', 'PDOMapping=', ''),
    ('DefaultValue=nonsense', 'PDOMapping=0;', ''),
    ('DataType=0x0007', 'DataType=0x0007 # UNSIGNED32', ''),
    ('Factor=0.01', 'Factor=a lot', "Factor left out: 'a lot' is no number"),
    ('Factor=0.01', 'Factor=', 'Factor left out: it is empty'),
    ('Factor=0.01', 'Factor=0', "Factor left out: '0' is no scale"),
    ('Factor=0.01', 'Factor=nan', "Factor left out: 'nan' is no scale"),
    ('AccessType=rww', 'AccessType=sometimes',
     "ro: AccessType 'sometimes' is none of those that are known here"),
    ('AccessType=rww\n', '', 'ro: AccessType is missing'),
    ('LowLimit=1\n', 'LowLimit=abc\n', "LowLimit left out: 'abc' is no number"),
    ('LowLimit=1\n', 'LowLimit=-\n', "LowLimit left out: '-' is no number"),
    ('LowLimit=1\n', 'LowLimit=0x\n', "LowLimit left out: '0x' is no number"),
    ('LowLimit=1\n', 'LowLimit=$NODEID+1\n', "LowLimit left out: '$NODEID+1' is no number"),
    ('LowLimit=1\n', 'LowLimit=9000\n',
     'LowLimit 9000 and HighLimit 0x1770 left out: the first is above the second'),
    ('HighLimit=0x1770', f'HighLimit={10**400}', 'HighLimit left out: '),
    ('HighLimit=0x1770', f'HighLimit={10**40}', 'is beyond uint16, which ends at 65535'),
    ('ParameterName=Ramp time\n', '', 'ParameterName is missing'),
])
def test_a_key_that_is_odd_costs_no_entry(tmp_path: Path, old: str, new: str,
                                          remark: str) -> None:
    made = bring(tmp_path, old, new)
    assert len(made.parameters) == 9
    assert [each.section for each in made.built.left_out] == ['[2003]']
    assert remark in ' '.join(made.built.text.replace('\n  # ', ' ').split())


def test_what_no_key_says_is_read_only(tmp_path: Path) -> None:
    made = bring(tmp_path, 'AccessType=rww\n', '')
    assert made.parameters['ramp_time'].access is AccessMode.READ_ONLY


def test_a_record_without_a_head(tmp_path: Path) -> None:
    made = bring(tmp_path, '[1018]', '[Identity]')
    assert made.parameters['vendor_id'].index == 0x1018
    assert 'section [1018] is missing; what is imported are its sub-indices' in made.notes
    assert any('[Identity]' in line for line in made.left_out)


@pytest.mark.parametrize(('old', 'new', 'note'), [
    ('ParameterName=Flag', 'ParameterName=Flag\nParameterName=Again',
     'ParameterName stands twice in [2002], the first counts'),
    ('ParameterName=Flag', 'ParameterName=Flag\nwhat is this', 'neither a section nor KEY=VALUE'),
    ('[FileInfo]', '[FileInfo]\n[FileInfo]', 'stands twice, the first in line 1 counts'),
])
def test_what_is_odd_costs_nothing(tmp_path: Path, old: str, new: str, note: str) -> None:
    made = bring(tmp_path, old, new)
    assert len(made.parameters) == 9
    assert note in made.notes[0] and len(made.notes) == 2


@pytest.mark.parametrize(('entries', 'names'), [
    ('NrOfEntries=1\n2=Winding', ['temperatures', 'winding']),
    ('NrOfEntries=2\n1=Motor\n2=Winding', ['motor', 'winding']),
    ('1=Motor', ['motor', 'temperatures_2']),
    ('NrOfEntries=0', ['temperatures', 'temperatures_2']),
])
def test_elements_of_which_some_have_names(tmp_path: Path, entries: str,
                                           names: list[str]) -> None:
    # the numbers are those of the elements; NrOfEntries counts the names
    made = bring(tmp_path, 'NrOfEntries=1\n1=Motor', entries)
    assert [name for name, each in made.parameters.items() if each.index == 0x2010] == names
    assert len(made.parameters) == 9


@pytest.mark.parametrize(('old', 'new'), [
    ('ObjectType=0x9\n', 'ObjectType=0x9\nCompactSubObj=0\n'),
    ('ObjectType=0x9\n', 'ObjectType=0x8\nCompactSubObj=0x00\n'),
    ('[1018Sub1]', '[1018SUB1]'),
    ('[1018Sub1]', '[1018sub01]'),
])
def test_an_array_with_sections_of_its_own(tmp_path: Path, old: str, new: str) -> None:
    assert bring(tmp_path, old, new).parameters == bring(tmp_path).parameters


def test_an_object_that_stands_twice(tmp_path: Path) -> None:
    made = bring_in(tmp_path, EDS + '[2001]\nParameterName=Other\nDataType=6\nAccessType=rw\n',
                    'small.eds')
    assert 'speed_setpoint' in made.parameters and 'other' not in made.parameters
    assert told(made) == TOLD['twice']


@pytest.mark.parametrize('content', ['', 'just text', '[DeviceInfo]\nVendorName=x\n',
                                     '<?xml version="1.0"?>', 'Nr;Name\n1;a\n'])
def test_no_eds(tmp_path: Path, content: str) -> None:
    with pytest.raises(ImportFailed, match='small.eds: '):
        bring_in(tmp_path, content, 'small.eds')


def test_without_the_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.startswith('canopen'):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, '__import__', without)
    with pytest.raises(ImportFailed, match="-m pip install 'canopen>=2.3'"):
        bring(tmp_path)
