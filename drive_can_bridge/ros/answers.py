# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Answers to callers, whether they can be reached or not.

Sending takes the middleware a tenth of a second where it has discovered a caller only halfway, or
where caller and service do not match, which nobody tells the caller. The interpreter is not held
meanwhile (:class:`RclResponses`). The thread that answers is, once for each such client: what is
for it afterwards is left to a thread of their own, until one of them arrives.
"""

from collections.abc import Callable, Iterable
import ctypes
from functools import partial
import struct
import threading
from typing import Any, NamedTuple
import warnings

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.service import Service

from drive_can_bridge.clock import Clock, Mailbox, Worker
from drive_can_bridge.core.sentences import answer_not_delivered, answers_hold_up
from drive_can_bridge.ros.middleware import GONE, RCLError

#: rcl/types.h
RCL_RET_OK, RCL_RET_TIMEOUT = 0, 2
#: rcutils/error_handling.h: RCUTILS_ERROR_MESSAGE_MAX_LENGTH
_ERROR_LENGTH = 1024
#: ``rmw_service_info_t``: two stamps, and the request (``rmw_request_id_t``: client and number)
_INFO = struct.Struct('qq16sq')
_REQUEST_OFFSET, _CALLER_SIZE = struct.calcsize('qq'), 16
_POINTER = ctypes.sizeof(ctypes.c_void_p)
#: what stands before a C extension's own fields: the head of every object
_HEAD = object.__basicsize__

# that keep the interpreter, which these need, or are too short to let go of it for
_capsule_name = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object)(
    ('PyCapsule_GetName', ctypes.pythonapi))
_capsule_pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)(
    ('PyCapsule_GetPointer', ctypes.pythonapi))
_CREATE = ctypes.PYFUNCTYPE(ctypes.c_void_p)
_CONVERT = ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.py_object, ctypes.c_void_p)
_DESTROY = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)
_RESET_ERROR = ctypes.PYFUNCTYPE(None)
#: clients that are remembered as out of reach
CALLERS_MAX = 50
#: answers for one of them that wait; any others are not sent
WAITING_MAX = 2


class Unfit(Exception):
    """This way is none here: versions that nobody has tried. Nothing was sent."""


class Unreachable(Exception):
    """The middleware has waited for the caller, and given up: it will not receive its answer."""


class _ErrorString(ctypes.Structure):
    """``rcutils_error_string_t``."""

    _fields_ = [('str', ctypes.c_char * _ERROR_LENGTH)]


_GET_ERROR = ctypes.PYFUNCTYPE(_ErrorString)


class _Functions(NamedTuple):
    """What makes C messages of a type: see ``convert_from_py``."""

    create: Callable[[], int | None]
    convert: Callable[[Any, int], bool]
    destroy: Callable[[int], None]


class Response(NamedTuple):
    """
    An answer that is ready to be sent.

    :ivar request: address of the ``rmw_request_id_t``, for as long as there is the header.
    :ivar caller: who asked: the same for all calls of one client.
    """

    service: Service
    message: Any
    header: Any
    request: int
    functions: _Functions
    caller: bytes


class RclResponses:
    """
    Sends answers through rcl.

    ``rcl_send_response`` waits for a caller that the middleware has not found yet, or never will:
    rmw_fastrtps up to ``max_blocking_time`` of the writer, 0.1 s (``check_for_subscription`` in
    its ``custom_service_info.hpp``). rclpy calls it with the interpreter held (``service.cpp``),
    so every thread of the process waits: cycles, commands, stops. ctypes lets go of the
    interpreter around a call; so the same function is called that way, with the same arguments:

    * the service: ``Service.pointer`` is the address of its ``rcl_service_t``;
    * the response: as rclpy does it (``convert_from_py`` in its ``utils.cpp``), by the three
      functions that generated message classes carry as capsules (rosidl_generator_py,
      ``_msg.py.em``);
    * the request: the header that rclpy hands out is pybind11's wrapper of a
      ``rmw_service_info_t`` (``rmw/types.h``). Of what it holds pybind11 keeps the address first,
      right behind the head of the object (``instance::simple_value_holder`` in
      ``pybind11/detail/common.h``).

    The last is nobody's promise. So it is checked with the first header, before anything is done
    with it, against what rclpy itself says of that. Where it does not fit: :class:`Unfit`.

    :raises Unfit: the functions of rcl are not to be found.
    """

    def __init__(self) -> None:
        try:
            # finds them in what this library needs, which is the rcl that rclpy uses
            rcl = ctypes.CDLL(rclpy_implementation.__file__)
            self._send = rcl.rcl_send_response
            self._get_error = _GET_ERROR(('rcutils_get_error_string', rcl))
            self._reset_error = _RESET_ERROR(('rcutils_reset_error', rcl))
        except (AttributeError, OSError, TypeError) as error:
            raise Unfit(str(error)) from None
        self._send.restype = ctypes.c_int
        self._send.argtypes = [ctypes.c_void_p] * 3
        self._functions: dict[type, _Functions] = {}
        self._checked = False   # the layout of headers

    def prepare(self, service: Service, message: Any, header: Any) -> Response:
        """
        Make an answer ready.

        :param header: what rclpy has handed out with the request.
        :raises Unfit: before anything was done.
        """
        if type(header) is not rclpy_implementation.rmw_service_info_t:
            raise Unfit(f'a header of type {type(header).__name__}')
        if not self._checked:
            check_layout(header)
            self._checked = True
        request = _address_of(header) + _REQUEST_OFFSET
        kind = type(message)
        functions = self._functions.get(kind)
        if functions is None:
            functions = self._functions[kind] = _functions_of(kind)
        return Response(service, message, header, request, functions,
                        ctypes.string_at(request, _CALLER_SIZE))

    def send(self, response: Response) -> None:
        """
        Send an answer. Other threads run meanwhile; the service may be destroyed by them.

        :raises Unreachable: nobody will receive it.
        :raises InvalidHandle: the service is gone.
        :raises RCLError: as rclpy does.
        """
        functions, handle = response.functions, response.service.handle
        with handle:    # who destroys it meanwhile only has it destroyed at the end of this
            raw = functions.create()
            if raw is None:
                raise MemoryError
            try:
                if not functions.convert(response.message, raw):
                    raise TypeError(f'{type(response.message).__name__} cannot be converted')
                # what somebody left in this thread would be told together with what fails here
                self._reset_error()
                result = self._send(handle.pointer, response.request, raw)
            finally:
                functions.destroy(raw)
            if result == RCL_RET_OK:
                return
            text = self._get_error().str.decode(errors='replace')
            self._reset_error()
            if result == RCL_RET_TIMEOUT:
                raise Unreachable(text)
            raise RCLError(f'failed to send response: {text}')


def check_layout(header: Any) -> None:
    """
    Compare what stands in a header's memory with what rclpy says of it.

    :raises Unfit: it is not what it is taken for.
    """
    part = header.request_id    # wrapped anew: refers to this part of the header
    if min(type(each).__basicsize__ for each in (header, part)) < _HEAD + _POINTER:
        raise Unfit('headers are smaller than expected')
    address = _address_of(header)
    # one is a part of the other: so both are addresses, and may be read from
    if not address or _address_of(part) - address != _REQUEST_OFFSET:
        raise Unfit('headers keep something else where their address is expected')
    source, received, _, number = _INFO.unpack(ctypes.string_at(address, _INFO.size))
    if ((source, received, number)
            != (header.source_timestamp, header.received_timestamp, part.sequence_number)):
        raise Unfit('headers are laid out differently')


def _address_of(wrapper: Any) -> int:
    """Return what pybind11's wrapper of something keeps first: where that is."""
    return ctypes.c_size_t.from_address(id(wrapper) + _HEAD).value


def _functions_of(kind: type) -> _Functions:
    def address(name: str) -> int:
        try:
            capsule = getattr(type(kind), name)
            found = _capsule_pointer(capsule, _capsule_name(capsule))
        except (AttributeError, ValueError) as error:   # ValueError: not a capsule
            raise Unfit(f'{kind.__name__}.{name}: {error}') from None
        return int(found)
    return _Functions(_CREATE(address('_CREATE_ROS_MESSAGE')),
                      _CONVERT(address('_CONVERT_FROM_PY')),
                      _DESTROY(address('_DESTROY_ROS_MESSAGE')))


class Answers:
    """
    Sends answers. From any thread.

    :param warn: takes topic and text of a warning for the log, which may come again and again.
    :param info: takes one line for the log.
    """

    def __init__(self, warn: Callable[[str, str], None], info: Callable[[str], None],
                 clock: Clock) -> None:
        self._clock = clock
        self._warn = warn
        self._info = info
        self._rcl: RclResponses | None = None
        self._unfit = False
        self._lock = threading.Lock()
        #: clients out of reach: how many answers for them wait
        self._waiting: dict[bytes, int] = {}
        self._late: Mailbox[Callable[[], None] | None] = Mailbox(clock)
        self._thread: Worker | None = None
        self._ending = False

    def adopt(self, services: Iterable[Service]) -> None:
        """Have executors answer through this: they call ``send_response`` of the service."""
        for service in services:
            service.send_response = partial(self.send, service)  # type: ignore[method-assign]

    def send(self, service: Service, message: Any, header: Any) -> None:
        """
        Send an answer, in place of ``Service.send_response``.

        :raises TypeError: the message is none of its answers.
        :raises InvalidHandle: the service is gone.
        :raises RCLError: the context is gone.
        """
        kind: Any = service.srv_type
        if not isinstance(message, kind.Response):
            raise TypeError(f'{service.srv_name}: {type(message).__name__} is no answer')
        if not self._unfit:
            try:
                rcl = self._rcl = self._rcl or RclResponses()
                response = rcl.prepare(service, message, header)
            except Unfit as error:
                self._leave_to_rclpy(error)
            else:
                if response.caller in self._waiting:
                    self._defer(rcl, response)
                else:
                    self._deliver(rcl, response)
                return
        Service.send_response(service, message, header)

    def stop(self) -> None:
        """End; what waits for clients out of reach is not sent."""
        with self._lock:
            self._ending = True
        self._late.put(None)
        if self._thread is not None:
            self._thread.join(5.0)

    def _leave_to_rclpy(self, reason: Unfit) -> None:
        with self._lock:
            known, self._unfit = self._unfit, True
        if not known:
            # it tells of callers out of reach by a warning of Python's, with a line of its source
            warnings.filterwarnings('ignore', 'failed to send response', RuntimeWarning)
            self._info(answers_hold_up(str(reason)))

    def _defer(self, rcl: RclResponses, response: Response) -> None:
        """Leave an answer to the thread that may wait; enough wait there: it is lost."""
        caller = response.caller
        with self._lock:
            waiting = self._waiting.get(caller, 0)
            room = waiting < WAITING_MAX and not self._ending
            if room:
                self._waiting[caller] = waiting + 1
                if self._thread is None:
                    self._thread = self._clock.worker(self._run, 'late answers')
                    self._thread.start()
        if room:
            self._late.put(partial(self._deliver_late, rcl, response))
        else:
            self._tell(response.service)

    def _deliver(self, rcl: RclResponses, response: Response) -> None:
        caller = response.caller
        try:
            rcl.send(response)
        except Unreachable:
            with self._lock:
                self._waiting.setdefault(caller, 0)
                if len(self._waiting) > CALLERS_MAX:
                    del self._waiting[next(iter(self._waiting))]
            self._tell(response.service)
        else:
            if caller in self._waiting:
                with self._lock:
                    self._waiting.pop(caller, None)

    def _tell(self, service: Service) -> None:
        try:
            name = service.service_name
        except GONE:    # meanwhile; nobody misses the answer
            return
        self._warn(f'answer of {name}', answer_not_delivered(name))

    # -- the thread that waits for clients out of reach -------------------------------------------

    def _run(self) -> None:
        while self._do_one_job():
            pass

    def _do_one_job(self) -> bool:
        """Do what comes next, and forget it then."""
        job = self._late.get()
        if job is None or self._ending:
            return False
        job()
        return True

    def _deliver_late(self, rcl: RclResponses, response: Response) -> None:
        with self._lock:
            if response.caller in self._waiting:
                self._waiting[response.caller] -= 1
        try:
            self._deliver(rcl, response)
        except GONE:    # service or context are gone
            pass
        except Exception as error:  # noqa: BLE001  outermost call of a thread
            self._warn('answer', f'internal error in an answer: {type(error).__name__}: {error}')
