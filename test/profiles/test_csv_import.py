# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Tables as people have them, and the entries that come out."""

from pathlib import Path
from typing import Any

from import_builders import bring_in, told
import pytest
from transcripts import stories

from drive_can_bridge.core.parameters import AccessMode, Parameter, ParameterType, Storage
from drive_can_bridge.profiles import catalogue
from drive_can_bridge.profiles.catalogue import ImportFailed
from drive_can_bridge.profiles.csv_import import WrongColumns

TOLD = stories(__file__, 'imports.yaml')
ENGLISH = """\
Number,Name,Unit,Scale,Minimum,Maximum,Access,Type,Storage,Description
30,Ramp time,s,0.01,0.01,60,rw,uint16,eeprom,From standstill to maximum speed
50,Speed setpoint,rpm,0.1,"-3,000","3,000",rw,int16,ram,
209,Actual speed,rpm,0.1,,,ro,int16,,
"""
GERMAN = """\
Antrieb Müller;;;;;;;;;
;;;;;;;;;
Par.-Nr.;Bezeichnung;Einheit;Auflösung;Min.;Max.;Zugriff;Datentyp;Speicher;Bemerkung
Rampen;;;;;;;;;
P30;Ramp time;s;0,01;0,01;60,00;R/W;UINT;EEPROM;From standstill to maximum speed
50;Speed setpoint;1/min;0,1;-3.000;3.000;lesen/schreiben;INT;flüchtig;
0xD1;Actual speed;U/min;0,1;;;nur lesen;INT16;;
"""
ITALIAN = """\
Numero parametro\tDenominazione\tUnità di misura\tRisoluzione\tCampo di valori\tAccesso\tTipo dati\
\tMemoria\tDescrizione
30\tRamp time\ts\t0,01\t0,01 ... 60,00\tlettura/scrittura\tUINT16\tEEPROM\tFrom standstill to \
maximum speed
50\tSpeed setpoint\tgiri/min\t1/10\t-3.000 ... 3.000\tL/S\tINT16\tRAM\t
D1h\tActual speed\tgiri/min\t1/10\t\tsola lettura\tINT16\t\t
"""
RESULT = {
    'ramp_time': Parameter(
        'ramp_time', number=30, scale=0.01, unit='s', storage=Storage.EEPROM, minimum=0.01,
        maximum=60.0, scaled=True, description='Ramp time; From standstill to maximum speed'),
    'speed_setpoint': Parameter(
        'speed_setpoint', ParameterType.INT16, number=50, scale=0.1, unit='rpm',
        storage=Storage.RAM, minimum=-3000.0, maximum=3000.0, scaled=True,
        description='Speed setpoint'),
    'actual_speed': Parameter(
        'actual_speed', ParameterType.INT16, number=209, scale=0.1, unit='rpm',
        access=AccessMode.READ_ONLY, scaled=True, description='Actual speed'),
}


@pytest.mark.parametrize(('text', 'encoding'), [
    (ENGLISH, 'utf-8'), (ENGLISH, 'utf-8-sig'), (GERMAN, 'cp1252'), (GERMAN, 'latin-1'),
    (GERMAN, 'utf-8-sig'), (GERMAN, 'utf-16'), (ITALIAN, 'latin-1'), (ITALIAN, 'utf-8'),
    (GERMAN.replace('\n', '\r\n'), 'cp1252'), (GERMAN.replace(';', '|'), 'utf-8'),
    (GERMAN.replace('\n', '\n\n').rstrip('\n'), 'utf-8'),
])
def test_three_languages_one_profile(tmp_path: Path, text: str, encoding: str) -> None:
    made = bring_in(tmp_path, text.encode(encoding))
    assert made.parameters == RESULT
    assert made.left_out == []


def test_every_entry_says_where_it_stands(tmp_path: Path) -> None:
    bring_in(tmp_path, ENGLISH)
    text = (tmp_path / 'made.yaml').read_text()
    assert "source: 'file, line 3'" in text and 'file: table.csv' in text


@pytest.mark.parametrize(('heading', 'row', 'expected'), [
    # where the unit may stand
    ('Nr;Name;Min [rpm]', '1;a;-5', {'unit': 'rpm', 'minimum': -5.0}),
    ('Nr;Name;Max (Hz)', '1;a;5', {'unit': 'Hz', 'maximum': 5.0}),
    ('Nr;Name [s];Type', '1;a;uint16', {'unit': ''}),
    ('Nr;Name;Type', '1;a [s];uint16', {'unit': 's', 'name': 'a'}),
    ('Nr;Name;Scale', '1;a;0.1 Hz', {'unit': 'Hz', 'scale': 0.1}),
    ('Nr;Name;Unit', '1;a;0,1 Hz', {'unit': 'Hz', 'scale': 0.1}),
    ('Nr;Name;Unit', '1;a;1/min', {'unit': 'rpm', 'scale': 1.0}),
    ('Nr;Name;Range', '1;a;0 … 50 Hz', {'unit': 'Hz', 'maximum': 50.0}),
    ('Nr;Name;Unit;Min [rpm]', '1;a;;5', {'unit': ''}),
    ('Nr;Name;Einheit / Unit', '1;a;Nm', {'unit': 'N m'}),
    # how the scale may be said
    ('Nr;Name;Divisor', '1;a;10', {'scale': 0.1}),
    ('Nr;Name;Nachkommastellen', '1;a;2', {'scale': 0.01}),
    ('Nr;Name;Factor', '1;a;1/3', {'scale': pytest.approx(1 / 3)}),
    ('Nr;Name;Factor;Offset', '1;a;0.5;-40', {'scale': 0.5, 'offset': -40.0}),
    # which one it is
    ('Register (hex);Name', '1F;a', {'number': 31}),
    ('PNU;Name', '0x1F;a', {'number': 31}),
    ('Parameter;Name', 'P 102;a', {'number': 102}),
    ('Parameter;Nr', 'Ramp time;102', {'number': 102, 'name': 'ramp_time'}),
    ('Parameter;Name', 'P613[-05];a', {'number': 613, 'subindex': 4}),
    ('Parameter;Index;Name', 'P102;2;a', {'number': 102, 'subindex': 2}),
    ('Index;Subindex;Name', '2004h;10h;a', {'index': 0x2004, 'subindex': 0x10}),
    ('Index;Subindex;Name', '0x2004;16;a', {'index': 0x2004, 'subindex': 16}),
    ('Index;Name', '2004:0A;a', {'index': 0x2004, 'subindex': 10}),
    ('Index;Name', '0x2004;a', {'index': 0x2004, 'subindex': 0}),
    ('Modbus-Register;Objekt;Name', '465;2004.10h;a',
     {'number': 465, 'index': 0x2004, 'subindex': 16}),
    # types
    ('Nr;Name;Typ', '1;a;WORD', {'type': ParameterType.UINT16}),
    ('Nr;Name;Typ', '1;a;DINT', {'type': ParameterType.INT32}),
    ('Nr;Name;Typ', '1;a;BOOL', {'type': ParameterType.BOOL}),
    ('Nr;Name;Typ', '1;a;Byte', {'type': ParameterType.UINT16, 'maximum': 255.0}),
    ('Nr;Name;Min;Max', '1;a;-5;5', {'type': ParameterType.INT16}),
    ('Nr;Name;Max', '1;a;70000', {'type': ParameterType.UINT32}),
    ('Nr;Name;Max;Scale', '1;a;70000;10', {'type': ParameterType.UINT16}),
    # limits that the type sets anyway
    ('Nr;Name;Typ;Max', '1;a;uint16;70000', {'maximum': None}),
    ('Nr;Name;Typ;Min', '1;a;uint16;-1', {'minimum': None}),
    ('Nr;Name;Bits', '1;a;"0=Ready, 3: Fault now"', {'bits': (('ready', 0), ('fault_now', 3))}),
    ('Nr;Beschreibung', '1;Größe des Stroms', {'name': 'groesse_des_stroms',
                                               'description': 'Größe des Stroms'}),
    ('Nr;Name', '1;"say ""hi"": {yes}, #1"', {'description': 'say "hi": {yes}, #1'}),
    ('Nr;Name', "1;it's", {'description': "it's"}),
    ('Nr;Name', '1;0x10', {'description': '0x10'}),
    ('Nr;Name', '1;true', {'description': 'true', 'name': 'true_value'}),
])
def test_one_row(tmp_path: Path, heading: str, row: str, expected: dict[str, Any]) -> None:
    made = bring_in(tmp_path, f'{heading}\n{row}\n')
    assert made.left_out == []
    [parameter] = made.parameters.values()
    assert {key: getattr(parameter, key) for key in expected} == expected


@pytest.mark.parametrize(('row', 'reason'), [
    ('2;b;rpm;1;10;5;rw;int16', 'minimum 10 is above maximum 5'),
    ('2;b;rpm;0;;;rw;int16', "'0': a scale must not be 0"),
    ('2;b;rpm;1;x;;rw;int16', "'x' is no number"),
    ('2;b;rpm;1;P105;;rw;int16', "'P105' is no number"),
    ('2;b;s;1;10 ms;;rw;int16', "minimum '10 ms' is not in s"),
    ('2;b;;1;;1.000;rw;int16', "'1.000' may be 1 or 1000: say which with --decimal"),
    ('2;b;rpm;1;;;rw;REAL', "type 'REAL' is none of those that are known here"),
    ('2;b;rpm;1;;;maybe;int16', "access 'maybe' is none of those that are known here"),
    ('F0-01;b;rpm;1;;;rw;int16', "'F0-01' is no number"),
    ('70000;b;rpm;1;;;rw;int16', 'number 70000 is out of range, allowed is 0 to 65535'),
    ('1;b;rpm;1;;;rw;int16', 'the same address as in line 2'),
    (';b;rpm;1;;;rw;int16', 'has no number'),
    ('2;b;rpm;1e-320;;;rw;int16', '9.99989e-321 is too small'),
    ('2;b;rpm;1;100000;200000;rw;int16',
     'minimum int16 has no value in 100000 to 200000 rpm, allowed are limits around one (the '
     'nearest is 32767.0 rpm)'),
    ('2;b;;;0.5;;rw;int16', 'minimum 0.5 is no integer, allowed without scale, offset and unit '
                            'are integers'),
])
def test_what_is_left_out(tmp_path: Path, row: str, reason: str) -> None:
    made = bring_in(tmp_path, f'Nr;Name;Unit;Scale;Min;Max;Access;Type\n1;a;;;;;rw;int16\n{row}\n')
    assert list(made.parameters) == ['a']
    [line] = made.left_out
    assert line.startswith('3: ') and line.endswith(f': {reason}')


@pytest.mark.parametrize('heading', ['', 'Table of "drives"\n', '"A\ntable";of;drives\n'])
def test_quotes(tmp_path: Path, heading: str) -> None:
    made = bring_in(tmp_path, heading + '''No.;Name;Unit
1;"Ramp; up";s
2;"Speed
of ""motor""";rpm
3;Wheel 12";mm
4;"Torque" now;%
''')
    assert [parameter.description for parameter in made.parameters.values()] == [
        'Ramp; up', 'Speed of "motor"', 'Wheel 12"', 'Torque now']
    assert made.left_out == []


def test_a_quote_that_another_row_closes(tmp_path: Path) -> None:
    made = bring_in(tmp_path, """No.;Name;Unit
1;Ramp;s
2;"Encoder wheel 10 inch;mm
3;"Torque";%
4;Current;A
""")
    assert list(made.parameters) == ['ramp', 'current']
    assert told(made) == TOLD['quote']


def test_a_table_that_no_bridge_would_read(tmp_path: Path,
                                           monkeypatch: pytest.MonkeyPatch) -> None:
    def check(tree: object) -> None:
        raise AssertionError('that takes long, and is in vain')
    monkeypatch.setattr(catalogue, 'profile_from_tree', check)
    rows = ''.join(f'{number};parameter {number};{"x" * 48_000}\n' for number in range(100))
    with pytest.raises(ImportFailed, match='table.csv: the profile of its 100 entries would be '
                                           'larger than 4 MiB, which no bridge reads'):
        bring_in(tmp_path, f'Nr;Name;Description\n{rows}')


@pytest.mark.parametrize(('sign', 'maximum'), [(',', 1000), ('.', 1)])
def test_ambiguous_numbers_can_be_settled(tmp_path: Path, sign: str, maximum: int) -> None:
    made = bring_in(tmp_path, 'Nr;Name;Max\n1;a;1.000\n', sign=sign)
    assert made.parameters['a'].maximum == maximum


def test_order_and_equal_names(tmp_path: Path) -> None:
    made = bring_in(tmp_path, 'Nr;Name\n20;Ramp\n3;Speed\n10;Ramp\n')
    assert list(made.parameters) == ['speed', 'ramp', 'ramp_20']
    assert made.parameters['ramp'].number == 10


def test_remarks_stand_above_the_entry(tmp_path: Path) -> None:
    bring_in(tmp_path, 'Nr;Name;Max\n1;a;70000\n')
    text = (tmp_path / 'made.yaml').read_text()
    assert '  # type uint32: not in the table, chosen by the limits\n  a:\n' in text


@pytest.mark.parametrize(('columns', 'table', 'expected'), [
    ('number=Kennzahl,name=Text', 'Nr;Kennzahl;Name;Text\n1;101;a;Speed\n2;102;b;Torque\n',
     {'speed': (101, ''), 'torque': (102, '')}),
    ('number=1,unit=2,name=3', '7;rpm;Speed\n8;A;Current\n',
     {'speed': (7, 'rpm'), 'current': (8, 'A')}),
    ('unit=', 'Nr;Name;Unit\n1;a;rpm\n', {'a': (1, '')}),
], ids=['by heading', 'by place', 'off'])
def test_given_columns_win(tmp_path: Path, columns: str, table: str,
                           expected: dict[str, tuple[int, str]]) -> None:
    made = bring_in(tmp_path, table, columns=columns)
    assert {name: (each.number, each.unit) for name, each in made.parameters.items()} == expected


@pytest.mark.parametrize('columns', ['number=Nummer', 'number=9', 'number=0'])
def test_columns_that_are_not_there(tmp_path: Path, columns: str) -> None:
    with pytest.raises(WrongColumns):
        bring_in(tmp_path, 'Nr;Name\n1;a\n', columns=columns)


@pytest.mark.parametrize(('content', 'reason'), [
    (b'', 'no column with parameter numbers was found; no row looks like headings'),
    (b'Name;Unit\na;s\n', 'its headings are: Name, Unit'),
    (b'PK\x03\x04rest', 'is a workbook or an archive; save its table as CSV'),
    (b'%PDF-1.7', 'is a PDF; copy its table into a spreadsheet and save that as CSV'),
    (b'a\0b', 'is not a text file: it contains NUL characters'),
    (b'\xff\xfea', 'begins like utf-16 text and is none'),
    (b'"Nr;Name\n1;a\n2;b\n', 'table.csv: in line 1 a quote opens that is never closed'),
    (b'No.;Name\n1;Ramp\n2;"Current\n3;Speed\n', 'in line 3 a quote opens that is never closed'),
    (b'Nr;Name\n', 'no entry can be used: there is none'),
    (b'Nr;Name\nx;a\n',
     "no entry can be used; the first reason, in line 2: x a: 'x' is no number"),
    (b'Nr;Name\n1;' + b'x' * 200_000, 'line 2: cannot be split into cells: field larger than'),
])
def test_no_table(tmp_path: Path, content: bytes, reason: str) -> None:
    with pytest.raises(ImportFailed) as caught:
        bring_in(tmp_path, content)
    assert reason in str(caught.value) and 'table.csv: ' in str(caught.value)


TYPES = 'Nr;Name;Typ\n1;a;uint16\n2;b;uint32\n'


@pytest.mark.parametrize(('table', 'protocols'), [
    ('Nr;Name\n1;a\n', ['datamodel_extended', 'datamodel_standard', 'cannord', 'canopen_pkw']),
    (TYPES, ['cannord', 'canopen_pkw']),
    ('Nr;Name\n3000;a\n', ['datamodel_extended', 'datamodel_standard', 'canopen_pkw']),
    ('Index;Name\n2004h;a\n', ['canopen_pkw', 'cia402']),
    ('Nr;Name\n102.1;a\n', ['cannord'])])
def test_all_protocols_that_can_carry_the_table(tmp_path: Path, table: str,
                                                protocols: list[str]) -> None:
    assert list(bring_in(tmp_path, table).profile.protocols) == protocols


def test_what_the_given_one_cannot_carry_is_left_out(tmp_path: Path) -> None:
    made = bring_in(tmp_path, TYPES, protocols=('datamodel_extended',))
    assert list(made.parameters) == ['a']
    assert told(made) == TOLD['type']


@pytest.mark.parametrize(('protocols', 'name'), [
    ((), 'status_word'), (('cannord',), 'status_word_value')])
def test_names_that_a_protocol_has_built_in(tmp_path: Path, protocols: tuple[str, ...],
                                            name: str) -> None:
    made = bring_in(tmp_path, 'Nr;Name\n1;Status word\n', protocols=protocols)
    assert list(made.parameters) == [name]


def test_the_same_file_gives_the_same_text(tmp_path: Path) -> None:
    texts = {bring_in(tmp_path, GERMAN).built.text for _ in range(3)}
    assert len(texts) == 1
