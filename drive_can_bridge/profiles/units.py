# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Units as profiles spell them, and as they stand behind names and numbers.

Units that a joint converts get the spelling of :mod:`drive_can_bridge.core.configuration`, a few
others the usual one; every other unit stays as it was written.
"""

import re

from drive_can_bridge.profiles.yaml_text import one_line

#: spelling in the profile, then others, without case and spaces
_UNITS = """
rpm r/min rev/min 1/min min-1 min^-1 min⁻¹ u/min umin upm umdr/min umdr./min giri/min giri/minuto
rpm tr/min
rad/s rad/sec
deg/s °/s grad/s gradi/s
deg ° grad gradi degree degrees
rev umdr umdr. umdrehungen umdrehung giri turns revolutions
degC °c ℃ grdc gradc gradcelsius celsius
% percent prozent percento
Hz hertz
s sec sec. sek sek. seconds sekunden secondi
ms msec millisekunden
us µs μs
min min. minuten minutes minuti
h std std. hours stunden ore
V volt
A ampere amp
W watt
ohm ω
inc ink inkr inkremente increments counts
rpm/s 1/min/s
"""
#: those that need no other spelling
_PLAIN = 'rad kHz mV mA kW kWh kVA kvar kg mm m m/s mm/s bar Hz/s V/Hz'
_SPELLINGS = {other.lower(): words.split()[0] for words in (
    *_UNITS.strip().splitlines(), *_PLAIN.split()) for other in words.split()}
#: where upper and lower case matter: newton metres are no nanometres
_EXACT = {'Nm': 'N m', 'N·m': 'N m', 'N*m': 'N m', 'Ω': 'ohm', 'kΩ': 'kohm', 'mΩ': 'mohm',
          **{each: each for each in ('N m', 'N', 'kN', 'K', 'F', 'H', 'mH')}}
_NO_UNIT = frozenset('- -- – — / 1 n/a na none ohne keine nessuna [-] (-)'.split()) | {''}
#: a unit at the end: in brackets, behind a comma or "in", or a sign
_ENDS = (re.compile(r'\s*[\[(]([^\[\]()]{1,20})[\])]\s*$'),
         re.compile(r'(?:,|\s/|\bin)\s*([^\s,]{1,12})\s*$', re.IGNORECASE),
         re.compile(r'\s*(°\s?C|℃|°|%)\s*$'))


def known_unit(text: str) -> str | None:
    """Return the profile's spelling of a unit; None: it is not known as one."""
    plain = one_line(text).strip('[]() ')
    return _EXACT.get(plain) or _SPELLINGS.get(plain.lower().replace(' ', ''))


def unit(text: str) -> str:
    """Return the unit of a cell as it goes into the profile; '' for none."""
    plain = one_line(text)
    if plain.lower() in _NO_UNIT:
        return ''
    return known_unit(plain) or plain.strip('[]() ')


def split_unit(text: str) -> tuple[str, str]:
    """
    Separate a text from the unit at its end.

    >>> split_unit('Ramp time [s]'), split_unit('Position (set 2)')
    (('Ramp time', 's'), ('Position (set 2)', ''))
    """
    for pattern in _ENDS:
        match = pattern.search(text)
        found = known_unit(match[1]) if match else None
        if match and found and text[:match.start()].strip():
            return text[:match.start()].strip(), found
    return text.strip(), ''
