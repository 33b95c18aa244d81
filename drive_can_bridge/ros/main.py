# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The executable ``drive_can_bridge``.

All executors run in threads; the main thread waits for a signal or a fatal error, and then: stops
the drives, publishes a last diagnostic message, stops the executor, closes the buses, shuts down.

Loading rclpy and its messages takes a second. Signals are handled before that, which is why
everything heavy is imported inside functions here.
"""

from collections.abc import Callable, Iterator, MutableMapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
import gc
import os
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from drive_can_bridge.clock import Clock, SteadyClock
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.sentences import (
    ends_before_stop, may_still_be_running, profiles_not_read, profiles_not_there,
    protection_not_read)
from drive_can_bridge.memory import keep_reserves
from drive_can_bridge.process.beginning import leave
from drive_can_bridge.process.environment import domain_problem
from drive_can_bridge.process.fast_dds import MAPS, running
from drive_can_bridge.process.scheduling import be_punctual
from drive_can_bridge.process.signals import NOT_SUSPENDED, SignalWatcher
from drive_can_bridge.process.standard_outputs import StandardOutputs
from drive_can_bridge.resources import config_file, what_is_missing

if TYPE_CHECKING:
    from drive_can_bridge.ros.bridge_node import BridgeNode

USAGE = """usage: drive_can_bridge --ros-args --params-file FILE [-r ...] [-p ...]
Bridge motor drives on CAN buses to ROS 2. Only ROS arguments are taken; 'drive_can validate FILE'
checks a parameter file, 'drive_can demo' shows the bridge with simulated drives."""


def main(args: Sequence[str] | None = None) -> int:
    """Run the bridge until a signal; return the exit code."""
    arguments = list(sys.argv if args is None else args)
    keep_reserves()
    be_punctual()
    # in a process of our own, signals are looked after to the very end
    clock = SteadyClock()
    with SignalWatcher(clock, keep=args is None, refuse=_refuse_to_suspend) as watcher:
        _load_rcl()
        with StandardOutputs(clock) as outputs:
            watcher.last_steps.append(outputs.flush)
            _tell_rcutils(outputs)
            code = watcher.exit_code(_code_of(lambda: run(watcher, clock, arguments)))
            if args is None:
                sys.stdout.flush()
                sys.stderr.flush()
                outputs.flush()
                leave(code)
            return code


def _load_rcl() -> None:
    """
    Load rcl while the outputs are as they were.

    Where its middleware is not installed it prints so, and ends the process on the spot: what is
    in a pipe by then is never read. Other errors are reported where it is used.
    """
    with suppress(Exception):
        import drive_can_bridge.ros.rcl.extension  # noqa: F401


def _code_of(work: Callable[[], int]) -> int:
    try:
        return work()
    except ImportError as error:
        return _complain(what_is_missing('drive_can_bridge', error))
    except Exception as error:  # noqa: BLE001  no traceback ever reaches a user
        return _complain(command_sentences.internal_error_of_bridge(
            kind=type(error).__name__, text=error))


def _complain(text: str) -> int:
    print(text, file=sys.stderr, flush=True)
    return 1


def _tell_rcutils(outputs: StandardOutputs) -> None:
    """Make rcutils write as if its output were no pipe."""
    on_output = os.environ.get('RCUTILS_LOGGING_USE_STDOUT') == '1'
    if (outputs.output if on_output else outputs.error).is_terminal:
        os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', '1')
    if on_output:   # in lines; C would keep them until some kilobytes are full
        os.environ.setdefault('RCUTILS_LOGGING_BUFFERED_STREAM', '1')


def _refuse_to_suspend() -> None:
    print(f'drive_can_bridge: {NOT_SUSPENDED}', file=sys.stderr, flush=True)


def run(watcher: SignalWatcher, clock: Clock, arguments: list[str]) -> int:
    """
    Run the bridge until its watcher ends it.

    :param arguments: those of the command line, the program's name first.
    :return: the exit code unless a signal decides it.
    """
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import remove_ros_args

    try:
        with _quiet_rcl():
            rest = remove_ros_args(arguments)[1:]
    except Exception as error:  # noqa: BLE001  it parses them all, files included
        return _complain(f'drive_can_bridge: {_parse_error(error, arguments)}')
    if rest:
        if rest[0] in ('-h', '--help'):
            print(USAGE)
            return 0
        print(f'drive_can_bridge: {rest[0]}: only ROS arguments are taken '
              f'(drive_can_bridge --ros-args --params-file FILE)', file=sys.stderr)
        return 2
    why = domain_problem()
    if why:
        return _complain(f'drive_can_bridge: {why}')
    unprotected, warnings = set_up_fast_dds()
    if unprotected:
        return _complain(f'drive_can_bridge: {unprotected}')
    try:
        with _quiet_rcl():
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # noqa: BLE001  rcl's parse errors come as several types
        return _complain(f'drive_can_bridge: {_parse_error(error, arguments)}')
    try:
        return _run(watcher, clock, arguments, warnings)
    except ExternalShutdownException:
        return 0
    finally:
        context = rclpy.get_default_context()  # the next call makes a new one
        rclpy.try_shutdown()
        # what is left of the nodes holds shared memory of the middleware
        context.destroy()
        gc.collect()


def set_up_fast_dds(environment: MutableMapping[str, str] = os.environ,
                    maps: Path = MAPS) -> tuple[Sentence, list[Sentence]]:
    """
    Make Fast DDS use the bridge's profile, unless the user has profiles of their own.

    Fast DDS makes room for a hundred messages at each end of each of them before there is one. A
    drive has about thirty ends, most of which never see as many. So histories begin small and
    grow where they have to; how many messages they keep is each topic's quality, as ever. And it
    wakes a thread of its own for every sample that a reliable reader gets, which costs as much as
    a tenth of the bridge; in this profile one wake-up in 20 ms serves all of them.

    To be called before ``rclpy.init``. Other middleware ignores it.

    :param maps: what this process has loaded.
    :return: why the bridge must not run, or empty; and lines for the log.
    """
    from rclpy.utilities import get_rmw_implementation_identifier

    middleware, folder = running(get_rmw_implementation_identifier(), maps), Path()
    warnings = []
    for each in middleware.ignored(environment, folder):
        if each.protects:
            return protection_not_read(each.name, middleware.name, each.file, each.instead), []
        warnings.append(profiles_not_read(each.name, middleware.name, each.instead))
    warnings += [profiles_not_there(name, file, middleware.name)
                 for name, file in middleware.missing(environment, folder)]
    if middleware.release is not None and not middleware.has_profiles(environment, folder):
        with suppress(FileNotFoundError):   # it only costs more
            middleware.use(config_file(middleware.release.shipped), environment)
    return NOTHING, warnings


def _run(watcher: SignalWatcher, clock: Clock, arguments: Sequence[str],
         warnings: Sequence[Sentence]) -> int:
    import rclpy

    from drive_can_bridge.ros.bridge_node import BridgeNode
    from drive_can_bridge.ros.log import FEW
    from drive_can_bridge.ros.threads import ExecutorThread
    from drive_can_bridge.transport.failures import in_words
    from drive_can_bridge.transport.library_logs import LibraryLogs

    spinner = ExecutorThread('services', lambda text: bridge.log.error(text),
                             rclpy.get_default_context(), clock)
    try:
        bridge = BridgeNode(spinner, watcher.fatal, clock, files=_parameter_files(arguments))
    except Exception as error:  # noqa: BLE001  names and namespaces that rcl refuses
        return _complain(f'drive_can_bridge: {in_words(error)}')
    for warning in warnings:
        bridge.log.warning(warning)
    libraries = bridge.log.source('library')
    LibraryLogs(partial(libraries.warn, few=FEW), clock.now).install()
    if bridge.is_empty:
        bridge.log.fatal(_nothing_configured(bridge, arguments))
        bridge.close()
        bridge.destroy_node()
        return 1
    spinner.start()
    last_words = partial(_name_the_unstopped, bridge)
    watcher.last_steps.insert(0, last_words)
    code = 0
    try:
        try:
            if not watcher.signalled:  # else nothing is started that would have to be stopped
                if bridge.autostart and not bridge.start(lambda: watcher.signalled):
                    code = 1
                elif watcher.wait():
                    code = 1
        finally:    # whatever dies
            bridge.stop()
    finally:
        watcher.last_steps.remove(last_words)   # which keeps the node
        spinner.stop()
        bridge.close()
        bridge.destroy_node()
    return code


def _name_the_unstopped(bridge: 'BridgeNode', _: float) -> None:
    """Print whose stop is cut short by a second signal."""
    for name, drive in list(bridge.drives.items()):
        session = drive.session
        if not session.stopped and session.may_run:
            print(f'{name}: {may_still_be_running(ends_before_stop())}',
                  file=sys.stderr, flush=True)


def _nothing_configured(bridge: 'BridgeNode', arguments: Sequence[str]) -> str:
    from drive_can_bridge.configuration.parameter_file import read_sections
    from drive_can_bridge.core import complaints

    told = [complaints.nothing_configured(node=bridge.get_fully_qualified_name())]
    for path in _parameter_files(arguments):
        try:
            names = [section.name for section in read_sections(Path(path))[0]]
        except OSError:
            continue
        told.append(complaints.file_is_for(file=path, nodes=', '.join(names) or 'no node'))
    return '; '.join(told)


def _parameter_files(arguments: Sequence[str]) -> list[str]:
    return [value for option, value in zip(arguments, arguments[1:])
            if option == '--params-file']


def _parse_error(error: Exception, arguments: Sequence[str]) -> str:
    """Return what is wrong with a file, or rcl's words without positions of its C sources."""
    from drive_can_bridge.configuration.parameter_file import read_sections
    from drive_can_bridge.configuration.problems import report
    from drive_can_bridge.transport.failures import in_words

    for path in map(Path, _parameter_files(arguments)):
        try:
            problems = report(read_sections(path)[1])
        except OSError:     # which rcl reports, too
            continue
        if problems:
            more = f' (drive_can validate {path} shows all)' if problems[1:] else ''
            return f'{problems[0]}{more}'
    text = in_words(error).replace('failed to initialize rcl: ', '')
    if text.startswith('['):  # a bare list of what it does not know
        return f'unknown ROS arguments: {text}'
    return text.split(', at /')[0]


@contextmanager
def _quiet_rcl() -> Iterator[None]:
    """Hold back rcl's own lines on standard error; print them only if all went well."""
    sys.stderr.flush()
    saved = os.dup(2)
    # a file would need a disk that can be written, and not every Python has memfd_create
    reading, writing = os.pipe()
    os.set_blocking(writing, False)     # not read meanwhile: what does not fit is lost
    os.dup2(writing, 2)
    os.close(writing)
    with open(reading, 'rb') as held:
        try:
            yield
        finally:
            os.dup2(saved, 2)   # the last end to write to is closed
            os.close(saved)
        text = held.read().decode(errors='replace')
    if text:
        sys.stderr.write(text)


if __name__ == '__main__':
    sys.exit(main())
