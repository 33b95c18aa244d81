# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The pictures of README and docs, in one style: ``make pictures``.

Each is a function in ``PICTURES`` that writes one file. Nothing is drawn by hand: the live view is
that of a demo which really runs, exported by rich, and so is the diagram of the architecture; the
arm is a record of simulated axes. The panel is seen in a real browser; where none is installed its
pictures are left out.
"""

import argparse
from collections.abc import Callable, Sequence
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile
import time

# before rclpy is imported: nothing leaves this machine, nor meets a demo that runs here
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('DRIVE_CAN_LOCAL', 'off')     # no other bridge of this machine is in them
os.environ.setdefault('ROS_DOMAIN_ID', '96')

import panel_pictures
from panel_pictures import care
from rich import box
from rich.console import Console, Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from drive_can_bridge.monitor.model import Model
from drive_can_bridge.ros.monitor.client import MonitorClient
from drive_can_bridge.view.live import Choice, page, Setting
from drive_can_bridge.view.parts import TREND_SPAN

HERE = Path(__file__).resolve().parent
#: columns and lines of the live view
SIZE = (138, 33)
#: lines of the architecture's boxes
_HEIGHT = 20
#: s that the demo may take to come up
_START_TIMEOUT = 120.0
_FRAME_PERIOD = 0.25
#: rich's SVG wants a font from a server; a picture is complete in itself
_SUPERFLUOUS = re.compile(r'@font-face \{.*?\}\s*|<!--.*?-->\s*', re.DOTALL)
_FONTS = 'Fira Code, DejaVu Sans Mono, Menlo, Consolas, monospace'


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
    return (page(snapshot, Choice(drive='/lift'), Setting(), width=SIZE[0], height=SIZE[1]),
            not any(drive.missed for drive in snapshot.drives))


def architecture(path: Path) -> None:
    """Draw what runs in which process, and what goes from where to where."""
    graph = _lines(['', '~/command/…', '~/joint_command', '', '~/<parameter>', '~/response',
                    '~/request', '~/online', '', 'ros2 param …', '~/enable …', '',
                    '/diagnostics', '/rosout'])
    ros = _lines(['', 'command intake', '', '', 'sample publisher', '', '', '', '',
                  'parameter services', 'control services', '', 'diagnostics', 'lifecycle'])
    session = Panel(_lines(['protocols/ + core/', 'no clock, no thread', '', 'setpoints, arming',
                            'control word', 'cyclic exchange', 'acyclic channel', 'map check', '',
                            'codec: bytes ⇄ values'], 'center'),
                    title='session of a drive', border_style='cyan', box=box.ROUNDED)
    exchange = Group(_lines(['timer thread', 'one lock per bus'], 'center', 'bright_black'),
                     session)
    transport = _lines(['reader thread', '', 'python-can', '', '', 'acceptance filters',
                        'reconnection', 'error frames', '', '', 'serial writer'], 'center')
    can = _lines(['', 'drive, station 1', '', 'drive, station 2', '', '…', '', '', 'or',
                  'drive_can simulate', 'over a', 'pseudo-terminal'], 'center')
    inside = _row([
        _titled('ros/', ros, 22), _arrows({1: '→', 4: '←', 9: '⇄', 12: '←'}),
        _titled('exchange/', exchange, 30), _arrows({3: '→', 6: '←'}),
        _titled('transport/', transport, 22)])
    bridge = Panel(inside, title='one process: drive_can_bridge', title_align='left',
                   border_style='bright_black', box=box.ROUNDED, width=82, height=_HEIGHT)
    picture = _row([
        _titled('ROS graph', graph, 19, 'green', _HEIGHT),
        _arrows({2: '→', 5: '←', 10: '⇄', 13: '←'}), bridge, _arrows({4: '→', 7: '←'}),
        _titled('CAN', can, 22, 'yellow', _HEIGHT)])
    clients = Panel(_lines(['drive_can monitor, read, write, backup … and your own nodes: '
                            'processes of their own, clients of the graph like any other']),
                    border_style='green', box=box.ROUNDED, width=127)
    _save(Group(picture, clients), path, 'drive_can_bridge: what goes where', 128, 23)


def arm(path: Path) -> None:
    """Draw what an axis does, and is told, through all that may come between."""
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder, 'arm.log')
        _record('ros2_control_run.py', trace)
        subprocess.run(
            [sys.executable, '-m', 'drive_can_bridge.cli.main', 'decode', trace, '--params-file',
             HERE.parent / 'config' / 'ros2_control' / 'arm.yaml', '--plot', path,
             *(f'shoulder.{name}' for name in ('position_setpoint', 'actual_position',
                                               'status_word'))],
            check=True)


def step_response(path: Path) -> None:
    """Draw how a drive follows its setpoint, from what ``drive_can record`` has heard."""
    with tempfile.TemporaryDirectory() as folder:
        trace, file = Path(folder, 'steps.log'), Path(folder, 'steps.yaml')
        _record('step_response_run.py', trace, file)
        subprocess.run(
            [sys.executable, '-m', 'drive_can_bridge.cli.main', 'decode', trace, '--params-file',
             file, '--plot', path,
             *(f'conveyor.{name}' for name in ('speed_setpoint', 'actual_speed',
                                               'motor_current'))],
            check=True)


def _record(script: str, *files: Path) -> None:
    """Have a story recorded; what another program disturbed on this machine is no picture."""
    for _ in range(3):
        if not subprocess.run([sys.executable, HERE / script, *files]).returncode:
            return
        for file in files:
            file.unlink(missing_ok=True)
    raise SystemExit(f'pictures: {script} failed three times')


def _lines(lines: Sequence[str], justify: str = 'left', style: str = '') -> Text:
    return Text('\n'.join(lines), justify=justify, style=style)  # type: ignore[arg-type]


def _titled(title: str, body: RenderableType, width: int, style: str = 'white',
            height: int = _HEIGHT - 2) -> Panel:
    return Panel(body, title=Text(title, style='bold'), width=width, height=height,
                 border_style=style, box=box.ROUNDED)


def _arrows(rows: dict[int, str]) -> Text:
    heads = {'→': '─▶', '←': '◀─', '⇄': '◀▶'}
    return Text('\n'.join(heads[rows[row]] if row in rows else '  ' for row in range(-1, 16)),
                style='bold cyan')


def _row(cells: Sequence[RenderableType]) -> Table:
    grid = Table.grid(padding=0)
    for _ in cells:
        grid.add_column(no_wrap=True)
    grid.add_row(*cells)
    return grid


def _save(body: RenderableType, path: Path, title: str, width: int, height: int) -> None:
    """Export something as rich shows it in a terminal of that size."""
    with open(os.devnull, 'w', encoding='utf-8') as nowhere:
        console = Console(record=True, width=width, height=height, force_terminal=True,
                          color_system='truecolor', file=nowhere)
        console.print(body, height=height)
        svg = console.export_svg(title=title, unique_id=path.stem)
    svg = _SUPERFLUOUS.sub('', svg).replace('font-family: Fira Code, monospace',
                                          f'font-family: {_FONTS}')
    path.write_text('\n'.join(line.rstrip() for line in svg.splitlines()) + '\n',
                    encoding='utf-8')


#: file -> what writes it
PICTURES: dict[str, Callable[[Path], None]] = {
    'monitor.svg': live_view,
    'monitor_fault.svg': live_view_of_a_fault,
    'architecture.svg': architecture,
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
