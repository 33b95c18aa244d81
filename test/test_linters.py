# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Style and types: what ``make lint`` runs, and ``colcon test``, each where it is installed."""

from importlib.util import find_spec
from pathlib import Path
import shutil
import subprocess
import sys
from typing import Any

import pytest

#: they compute: as long as others leave them the processors for
pytestmark = [pytest.mark.linter, pytest.mark.timeout(900)]
CHECKOUT = Path(__file__).resolve().parent.parent
SOURCES = ('drive_can_bridge', 'bench', 'docs', 'launch', 'test')


def passes(module: str, *words: str) -> None:
    """Run a linter over the checkout."""
    if find_spec(module) is None:
        pytest.skip(f'{module} is not installed')
    done = subprocess.run([sys.executable, '-m', module, *words], cwd=CHECKOUT, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    assert done.returncode == 0, done.stdout


def test_ruff() -> None:
    passes('ruff', 'check', '--quiet', '.')


def test_flake8() -> None:
    passes('flake8', *SOURCES, 'setup.py')


def test_types() -> None:
    passes('mypy')


def test_shell_scripts() -> None:
    scripts = [path for path in sorted((CHECKOUT / '.ci').rglob('*'))
               if path.is_file() and b'bash' in path.read_bytes().split(b'\n', 1)[0]]
    assert scripts
    for script in scripts:
        subprocess.run(['bash', '-n', script], check=True)


def test_ament_copyright(monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    """Our sources name the licence behind the copyright, in the same line: one more form."""
    parser = pytest.importorskip('ament_copyright.parser')
    main = pytest.importorskip('ament_copyright.main').main
    monkeypatch.chdir(CHECKOUT)
    apache = parser.get_licenses()['apache2']
    short = apache._replace(file_headers=[*apache.file_headers, '{copyright}'])
    monkeypatch.setattr(parser, 'get_licenses', lambda: {'apache2': short})
    assert main([*SOURCES, 'LICENSE', 'CONTRIBUTING.md']) == 0, capfd.readouterr()


def test_ament_xmllint(monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    main = pytest.importorskip('ament_xmllint.main').main
    if shutil.which('xmllint') is None:
        pytest.skip('xmllint is not installed')
    monkeypatch.chdir(CHECKOUT)
    code = main(['package.xml', 'config'])
    told = ''.join(capfd.readouterr())
    if 'failed to load external entity "http' in told:
        pytest.skip('the schema of package.xml cannot be had here')
    assert code == 0, told
