# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The pictures of README and docs, in one style: ``make pictures``.

Each is a function in ``PICTURES`` that writes one file. Nothing is drawn by hand: the live view is
that of a demo which really runs, the arm and the steps are records of simulated axes. The panel is
seen in a real browser; where none is installed its pictures are left out.
"""

import argparse
from collections.abc import Callable, Sequence
import json
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile
import time
from xml.sax.saxutils import escape

# before rclpy is imported: nothing leaves this machine, nor meets a demo that runs here
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('DRIVE_CAN_LOCAL', 'off')     # no other bridge of this machine is in them
os.environ.setdefault('ROS_DOMAIN_ID', '96')

import panel_pictures
from panel_pictures import care
from rich.cells import cell_len
from rich.console import Console, RenderableType
from rich.style import Style
from rich.terminal_theme import SVG_EXPORT_THEME

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.ros.monitor.client import MonitorClient
from drive_can_bridge.trace.files import read_records
from drive_can_bridge.trace.sinks import Plotter
from drive_can_bridge.trace.tracer import Channels, Tracer
from drive_can_bridge.view.live import Choice, page, ViewSetting
from drive_can_bridge.view.parts import TREND_SPAN

HERE = Path(__file__).resolve().parent
#: columns and lines of the live view
SIZE = (150, 33)
#: s that the demo may take to come up
_START_TIMEOUT = 120.0
_FRAME_PERIOD = 0.25
_FONTS = 'Fira Code, DejaVu Sans Mono, Menlo, Consolas, monospace'
#: of a character: width and height; and of letters
_CELL, _SIZE = (12.2, 24.4), 20
#: left, right and below; above
_EDGE, _TOP = 10, 42
_GROUND, _INK = '#292929', '#c5c8c6'
_BLOCKS = '▁▂▃▄▅▆▇█'
#: characters that fonts show in different widths, if at all
_DRAWN = f'─│╭╮╰╯░●○▸{_BLOCKS}'


def live_view(path: Path, *options: str) -> None:
    """Draw the live view of a demo whose drives move."""
    for _ in range(care.attempts):
        demo = subprocess.Popen(
            [sys.executable, '-m', 'drive_can_bridge.cli.main', 'demo', '--drive',
             '--params-file', str(HERE.parent / 'config' / 'demo.yaml'), *options],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            view, undisturbed = _watch(demo)
        finally:
            demo.send_signal(signal.SIGINT)
            demo.wait(timeout=20.0)
        if undisturbed:
            break
    else:
        print(f'pictures: {path.name}: exchanges were missed: make it again where nothing else '
              'runs', file=sys.stderr)
    _save(view, path, 'drive_can monitor', SIZE[0], SIZE[1])


def live_view_of_a_fault(path: Path) -> None:
    """Draw the same where one of the drives has tripped."""
    live_view(path, '--fault', 'lift:trip')


def _watch(demo: 'subprocess.Popen[bytes]') -> tuple[RenderableType, bool]:
    """
    Look at a demo until its trends are full and, if that can be had, without a gap.

    :return: the view, and whether every exchange was answered.
    """
    model = Model()
    client = MonitorClient(model)
    deadline = time.monotonic() + _START_TIMEOUT
    full_at: float | None = None
    while True:
        now = time.monotonic()
        client.poll(now)
        snapshot = model.look(now, time.time())
        if not snapshot.drives or not all(
                drive.state == 'fault' or drive.state == 'online' and drive.setpoints
                for drive in snapshot.drives):
            full_at = None  # on a busy machine one is lost now and then
        elif full_at is None:
            full_at = now + min(TREND_SPAN, care.wait)
        if full_at is not None and (now >= full_at or now > deadline):
            break
        if demo.poll() is not None or now > deadline + TREND_SPAN:
            raise SystemExit('pictures: the demo did not come up')
        time.sleep(_FRAME_PERIOD)
    client.close()
    return (page(snapshot, Choice(drive='/lift'), ViewSetting(), width=SIZE[0], height=SIZE[1]),
            not any(drive.missed for drive in snapshot.drives))


def arm(path: Path) -> None:
    """Draw what an axis does, and is told, through all that may come between."""
    with tempfile.TemporaryDirectory() as folder:
        trace, notes = Path(folder, 'arm.log'), Path(folder, 'notes.json')
        _record('ros2_control_run.py', trace, notes)
        _plot(trace, HERE.parent / 'config' / 'ros2_control' / 'arm.yaml', path,
              'One axis of three under a trajectory controller: after each loss it begins where '
              'it stands',
              [f'shoulder.{name}' for name in ('position_setpoint', 'actual_position',
                                               'status_word')],
              [(at, text) for at, text in json.loads(notes.read_text(encoding='utf-8'))])


def step_response(path: Path) -> None:
    """Draw how a drive follows its setpoint, from what ``drive_can record`` has heard."""
    with tempfile.TemporaryDirectory() as folder:
        trace, file = Path(folder, 'steps.log'), Path(folder, 'steps.yaml')
        _record('step_response_run.py', trace, file)
        _plot(trace, file, path,
              'Steps of the setpoint, as a simulated conveyor follows them on its ramp; 100 '
              'exchanges a second',
              [f'conveyor.{name}' for name in ('speed_setpoint', 'actual_speed',
                                               'motor_current')])


def _plot(trace: Path, file: Path, path: Path, title: str, values: Sequence[str],
          notes: Sequence[tuple[float, str]] = ()) -> None:
    """Draw what ``drive_can decode --plot`` draws, under a title."""
    configuration = configuration_from_file(file)
    plotter = Plotter(configuration, values, [])
    channels = Channels(list(configuration.buses.values()), {}, print)
    tracer = Tracer(configuration, plotter, channels)
    for record in read_records(trace, print):
        tracer.take(record)
    tracer.finish()
    plotter.draw(str(path), title, notes)


def _record(script: str, *files: Path) -> None:
    """Have a story recorded; what another program disturbed on this machine is no picture."""
    for _ in range(3):
        if not subprocess.run([sys.executable, HERE / script, *files]).returncode:
            return
        for file in files:
            file.unlink(missing_ok=True)
    raise SystemExit(f'pictures: {script} failed three times')


def _save(body: RenderableType, path: Path, title: str, width: int, height: int) -> None:
    """
    Export something as a terminal of that size shows it.

    Each word has a place of its own, and lines, bars and lamps are drawn: with whatever font, and
    in a renderer that does not stretch text, nothing shifts (a line that is one text does).
    """
    with open(os.devnull, 'w', encoding='utf-8') as nowhere:
        console = Console(width=width, height=height, force_terminal=True,
                          color_system='truecolor', file=nowhere)
        options = console.options.update(width=width, height=height)
        lines = console.render_lines(body, options)[:height]
    parts: list[str] = []
    for row, line in enumerate(lines):
        column = 0
        for segment in line:
            parts += _segment(segment.text, segment.style or Style(), column, row)
            column += cell_len(segment.text)
    across, down = 2 * _EDGE + width * _CELL[0], _TOP + _EDGE + height * _CELL[1]
    lamps = ''.join(f'<circle cx="{22 + 22 * place}" cy="20" r="7" fill="{colour}"/>'
                    for place, colour in enumerate(('#ff5f57', '#febc2e', '#28c840')))
    path.write_text('\n'.join([
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {across:g} {down:g}" '
        f'font-family="{_FONTS}" font-size="{_SIZE}" role="img">', f'<title>{title}</title>',
        f'<rect width="{across:g}" height="{down:g}" rx="8" fill="{_GROUND}"/>', lamps,
        f'<text x="{across / 2:g}" y="26" text-anchor="middle" fill="{_INK}" '
        f'font-family="Arial, Helvetica, sans-serif" font-weight="bold">{title}</text>',
        f'<g transform="translate({_EDGE} {_TOP})" xml:space="preserve">', *parts,
        '</g>', '</svg>', '']), encoding='utf-8')


def _segment(text: str, style: Style, column: int, row: int) -> list[str]:
    """Draw what stands side by side in one style."""
    ink = _INK
    if style.color is not None:
        ink = style.color.get_truecolor(SVG_EXPORT_THEME).hex
    if style.dim:
        ink = '#808280'
    weight = ' font-weight="bold"' if style.bold else ''
    wide, high = _CELL
    parts = []
    for found in re.finditer(f'[{_DRAWN}]+|[^ {_DRAWN}]+', text):
        left, top = (column + cell_len(text[:found.start()])) * wide, row * high
        if found[0][0] in _DRAWN:
            for place, character in enumerate(found[0]):
                parts.append(_drawn(character, left + place * wide, top, ink))
            continue
        length = cell_len(found[0]) * wide
        parts.append(f'<text x="{left:g}" y="{top + 0.75 * high:g}" textLength="{length:g}" '
                     f'lengthAdjust="spacingAndGlyphs" fill="{ink}"{weight}>'
                     f'{escape(found[0])}</text>')
    return _joined(parts)


def _drawn(character: str, left: float, top: float, ink: str) -> str:
    """Draw a character that is a shape."""
    wide, high = _CELL
    middle, centre, right, bottom = left + wide / 2, top + high / 2, left + wide, top + high
    line = {
        '─': f'M{left:g} {centre:g}H{right:g}', '│': f'M{middle:g} {top:g}V{bottom:g}',
        '╭': f'M{middle:g} {bottom:g}V{centre + 5:g}Q{middle:g} {centre:g} {right:g} {centre:g}',
        '╮': f'M{middle:g} {bottom:g}V{centre + 5:g}Q{middle:g} {centre:g} {left:g} {centre:g}',
        '╰': f'M{middle:g} {top:g}V{centre - 5:g}Q{middle:g} {centre:g} {right:g} {centre:g}',
        '╯': f'M{middle:g} {top:g}V{centre - 5:g}Q{middle:g} {centre:g} {left:g} {centre:g}',
    }.get(character)
    if line:
        return f'<path d="{line}" fill="none" stroke="{ink}"/>'
    if character in _BLOCKS:
        tall = high * (_BLOCKS.index(character) + 1) / 8
        return f'<path d="M{left:g} {bottom:g}v{-tall:g}h{wide:g}v{tall:g}z" fill="{ink}"/>'
    if character == '░':
        return (f'<path d="M{left:g} {bottom:g}v{-high:g}h{wide:g}v{high:g}z" fill="{ink}" '
                'fill-opacity="0.25"/>')
    if character == '▸':
        return f'<path d="M{left + 3:g} {centre - 5:g}l7 5l-7 5z" fill="{ink}"/>'
    filled = ink if character == '●' else 'none'
    return f'<circle cx="{middle:g}" cy="{centre:g}" r="4.5" fill="{filled}" stroke="{ink}"/>'


def _joined(parts: Sequence[str]) -> list[str]:
    """Make one path of those that follow each other and look the same."""
    found: list[str] = []
    for part in parts:
        path, end = re.fullmatch('<path d="(.*?)"(.*)', part), ''
        if path is not None and found:
            before = re.fullmatch('<path d="(.*?)"(.*)', found[-1])
            end = before[2] if before else ''
            if before is not None and end == path[2]:
                found[-1] = f'<path d="{before[1]}{path[1]}"{end}'
                continue
        found.append(part)
    return found


#: file -> what writes it
PICTURES: dict[str, Callable[[Path], None]] = {
    'monitor.svg': live_view,
    'monitor_fault.svg': live_view_of_a_fault,
    'ros2_control.png': arm,
    'step_response.png': step_response,
    **panel_pictures.PICTURES,
}


def main() -> int:
    """Write all pictures, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('names', nargs='*', metavar='NAME', help=', '.join(PICTURES))
    parser.add_argument('--directory', type=Path, default=HERE)
    parser.add_argument('--soon', action='store_true', help='take what there is after a second: '
                        'shows that they can be made')
    options = parser.parse_args()
    if options.soon:
        care.wait, care.attempts = 1.0, 1
    unknown = [name for name in options.names if name not in PICTURES]
    if unknown:
        parser.error(f'{", ".join(unknown)}: allowed are {", ".join(PICTURES)}')
    options.directory.mkdir(parents=True, exist_ok=True)
    for name in options.names or PICTURES:
        reason = panel_pictures.missing() if name in panel_pictures.PICTURES else ''
        if reason:
            print(f'not {name}: {reason}', file=sys.stderr)
            continue
        path = options.directory / name
        PICTURES[name](path)
        print(path)
    return 0


if __name__ == '__main__':
    sys.exit(main())
