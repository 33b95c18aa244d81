# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Units as manuals write them, and as profiles have them.

Those that a joint converts get the spelling of :mod:`drive_can_bridge.core.units`, a few others
the usual one; every other unit stays as it was written. Only those known here are taken for units
where they stand in a name.
"""

from drive_can_bridge.profiles.text import one_line

#: spelling in the profile -> others, in lower case and without spaces
_SPELLINGS: dict[str, tuple[str, ...]] = {
    'rpm': ('rpm', 'r/min', 'rev/min', '1/min', 'min-1', 'min^-1', 'min⁻¹', 'u/min', 'umin',
            'upm', 'umdr/min', 'umdr./min', 'giri/min', 'giri/minuto', 'tr/min', 'rpm.'),
    'rad/s': ('rad/s', 'rad/sec'),
    'deg/s': ('deg/s', '°/s', 'grad/s', 'gradi/s'),
    'deg': ('deg', '°', 'grad', 'gradi', 'degree', 'degrees'),
    'rad': ('rad',),
    'rev': ('rev', 'umdr', 'umdr.', 'umdrehungen', 'umdrehung', 'giri', 'turns', 'revolutions'),
    'degC': ('degc', '°c', '℃', 'grdc', 'gradc', 'gradcelsius', 'celsius'),
    '%': ('%', 'percent', 'prozent', 'percento'),
    'Hz': ('hz', 'hertz'),
    'kHz': ('khz',),
    's': ('s', 'sec', 'sec.', 'sek', 'sek.', 'seconds', 'sekunden', 'secondi'),
    'ms': ('ms', 'msec', 'millisekunden'),
    'us': ('us', 'µs', 'μs'),
    'min': ('min', 'min.', 'minuten', 'minutes', 'minuti'),
    'h': ('h', 'std', 'std.', 'hours', 'stunden', 'ore'),
    'V': ('v', 'volt'),
    'mV': ('mv',),
    'A': ('a', 'ampere', 'amp'),
    'mA': ('ma',),
    'W': ('w', 'watt'),
    'kW': ('kw',),
    'kWh': ('kwh',),
    'kVA': ('kva',),
    'kvar': ('kvar',),
    'ohm': ('ohm', 'ω', 'ω'),
    'kg': ('kg',),
    'mm': ('mm',),
    'm': ('m',),
    'm/s': ('m/s',),
    'mm/s': ('mm/s',),
    'bar': ('bar',),
    'Hz/s': ('hz/s',),
    'rpm/s': ('rpm/s', '1/min/s'),
    'V/Hz': ('v/hz',),
    'inc': ('inc', 'ink', 'inkr', 'inkremente', 'increments', 'counts'),
}
#: where upper and lower case matter: newton metres are no nanometres
_EXACT = {'Nm': 'N m', 'N·m': 'N m', 'N m': 'N m', 'N*m': 'N m', 'N': 'N', 'kN': 'kN', 'K': 'K',
          'F': 'F', 'H': 'H', 'mH': 'mH', 'Ω': 'ohm', 'kΩ': 'kohm', 'mΩ': 'mohm'}
_NONE = frozenset(('', '-', '--', '–', '—', '/', '1', 'n/a', 'na', 'none', 'ohne', 'keine',
                   'nessuna', '[-]', '(-)'))
_BY_SPELLING = {other: unit for unit, others in _SPELLINGS.items() for other in others}


def known_unit(text: str) -> str | None:
    """Return the profile's spelling of a unit; None: it is not known as one."""
    plain = one_line(text).strip('[]() ')
    return _EXACT.get(plain) or _BY_SPELLING.get(plain.lower().replace(' ', ''))


def unit(text: str) -> str:
    """Return the unit of a cell as it goes into the profile; '' for none."""
    plain = one_line(text)
    if plain.lower() in _NONE:
        return ''
    return known_unit(plain) or plain.strip('[]() ')
