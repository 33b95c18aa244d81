# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Requests and answers of services, straight from and to rcl, without holding the interpreter.

rclpy calls the middleware with the interpreter held (``service.cpp``), so every thread of the
process waits for it: cycles, commands, stops. ``rcl_take_request_with_info`` lasts for as long as
the middleware reads a request: some bytes of another one have kept it for a minute.
``rcl_send_response`` waits for a caller that the middleware has not found yet, or never will:
rmw_fastrtps up to ``max_blocking_time`` of the writer, 0.1 s (``check_for_subscription`` in its
``custom_service_info.hpp``). ctypes lets go of the interpreter around a call; so the same
functions are called that way, with the same arguments:

* the service: ``Service.pointer`` is the address of its ``rcl_service_t``;
* request and response: as rclpy does it (``utils.cpp``), by the functions that generated message
  classes carry as capsules (rosidl_generator_py, ``_msg.py.em``);
* the caller: a ``rmw_service_info_t`` (``rmw/types.h``).

What is too long in a request is cut before Python reads it (:mod:`.layout`); an exception of the
middleware leaves the thread where it is (:mod:`.escaped`).
"""

from collections.abc import Callable, Sequence
import ctypes
from itertools import repeat
from operator import is_
import struct
from typing import Any, NamedTuple

from rclpy.service import Service

from drive_can_bridge.ros.rcl import escaped
from drive_can_bridge.ros.rcl.extension import extension, RCLError
from drive_can_bridge.ros.rcl.layout import cut, ENTRIES_MAX, layout_of, MessageLayout
from drive_can_bridge.ros.rcl.unfit import Unfit

#: rcl/types.h
RCL_RET_OK, RCL_RET_TIMEOUT, RCL_RET_SERVICE_TAKE_FAILED = 0, 2, 601
#: rcutils/error_handling.h: RCUTILS_ERROR_MESSAGE_MAX_LENGTH
_ERROR_LENGTH = 1024
#: ``rmw_service_info_t``: two stamps, and the request (``rmw_request_id_t``: client and number)
_INFO = struct.Struct('qq16sq')
_REQUEST_OFFSET, _CALLER_SIZE = struct.calcsize('qq'), 16
#: bytes that are kept ready for one: any other version has less
_INFO_ROOM = 512
#: more than any client has ever asked
_NUMBER_MAX = 1 << 48

# that keep the interpreter, which these need, or are too short to let go of it for
_capsule_name = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object)(
    ('PyCapsule_GetName', ctypes.pythonapi))
_capsule_pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)(
    ('PyCapsule_GetPointer', ctypes.pythonapi))
_CREATE = ctypes.PYFUNCTYPE(ctypes.c_void_p)
_TO_C = ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.py_object, ctypes.c_void_p)
_TO_PYTHON = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
_RESET_ERROR = ctypes.PYFUNCTYPE(None)
# that may take their time
_DESTROY = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_RESIZE = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_size_t)
_COPY = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_void_p)

_WORD = ctypes.c_size_t
#: called with what was thrown, when a call will never return
Escaped = Callable[[str], object]


class Unreachable(Exception):
    """The middleware has waited for the caller, and given up: the answer will not arrive."""


class _ErrorString(ctypes.Structure):
    """``rcutils_error_string_t``."""

    _fields_ = [('str', ctypes.c_char * _ERROR_LENGTH)]


_GET_ERROR = ctypes.PYFUNCTYPE(_ErrorString)


class _Functions(NamedTuple):
    """The functions that convert messages of a type between C and Python."""

    create: Callable[[], int | None]
    to_c: Callable[[Any, int], bool]
    to_python: Callable[[int], Any]
    destroy: Callable[[int], None]


class Header:
    """
    The header of a request, which identifies its caller.

    :ivar caller: the same for all calls of one client.
    """

    __slots__ = ('address', '_memory')

    def __init__(self) -> None:
        self._memory = ctypes.create_string_buffer(_INFO_ROOM)
        self.address = ctypes.addressof(self._memory)

    @property
    def caller(self) -> bytes:
        """Return the bytes that all calls of one client have in common."""
        return ctypes.string_at(self.request, _CALLER_SIZE)

    @property
    def request(self) -> int:
        """Return the address of the ``rmw_request_id_t``, for as long as there is this."""
        return self.address + _REQUEST_OFFSET

    def check(self) -> None:
        """
        Check the header's layout against known values.

        :raises Unfit: it is laid out differently.
        """
        _, _, caller, number = _INFO.unpack_from(self._memory)
        if not any(caller) or not 0 < number < _NUMBER_MAX:
            raise Unfit('headers of requests are laid out differently')


class ReadyResponse(NamedTuple):
    """An answer with everything that sending it takes."""

    service: Service
    message: Any
    header: Header
    functions: _Functions
    caller: bytes


class RclServices:
    """
    Takes requests, and sends answers, by functions of rcl.

    :raises Unfit: something that this needs is not to be found.
    """

    def __init__(self) -> None:
        try:
            # finds them in what this library needs, which is the rcl that rclpy uses
            rcl = self._library = ctypes.CDLL(extension.__file__)
            self._take = rcl.rcl_take_request_with_info
            self._send = rcl.rcl_send_response
            self._get_error = _GET_ERROR(('rcutils_get_error_string', rcl))
            self._reset_error = _RESET_ERROR(('rcutils_reset_error', rcl))
        except (AttributeError, OSError, TypeError) as error:
            raise Unfit(str(error)) from None
        for function in self._take, self._send:
            function.restype = ctypes.c_int
            function.argtypes = [ctypes.c_void_p] * 3
        escaped.install(rcl)
        self._functions: dict[Any, _Functions] = {}
        self._checked = False   # the layout of headers

    def check(self, service: Service) -> None:
        """
        Check that a service can be served this way.

        :raises Unfit: it cannot.
        """
        kind: Any = service.srv_type
        self._functions_of(kind.Request)
        self._functions_of(kind.Response)
        layout_of(kind.Request)
        if not isinstance(getattr(service.handle, 'pointer', None), int):
            raise Unfit('services do not tell where they are')

    def take(self, service: Service, lost: Escaped) -> tuple[Any, Header] | None:
        """
        Return the oldest waiting request, with its header; None: there is none.

        A list that is too long has its first entry in every place.

        :param lost: called with what was thrown, if this will never return.
        :raises InvalidHandle: the service is gone.
        :raises RCLError: as rclpy does.
        """
        kind: Any = service.srv_type.Request    # type: ignore[attr-defined]
        functions = self._functions_of(kind)
        header, handle = Header(), service.handle
        with handle:    # a destruction meanwhile is put off to the end of this
            raw = functions.create()
            if raw is None:
                raise MemoryError
            try:
                self._reset_error()
                with escaped.guarded(lost):
                    result = self._take(handle.pointer, header.address, raw)
                if result == RCL_RET_SERVICE_TAKE_FAILED:
                    self._reset_error()
                    return None
                self._succeeded(result, 'take a request')
                if not self._checked:
                    header.check()
                    self._checked = True
                return _read(raw, layout_of(kind), functions), header
            finally:
                functions.destroy(raw)

    def prepare(self, service: Service, message: Any, header: Any) -> ReadyResponse:
        """
        Prepare an answer.

        :raises Unfit: its request was taken another way.
        """
        if not isinstance(header, Header):
            raise Unfit(f'a header of type {type(header).__name__}')
        return ReadyResponse(service, message, header, self._functions_of(type(message)),
                             header.caller)

    def send(self, response: ReadyResponse) -> None:
        """
        Send an answer. Other threads run meanwhile; the service may be destroyed by them.

        :raises Unreachable: it will not be received.
        :raises InvalidHandle: the service is gone.
        :raises RCLError: as rclpy does.
        """
        functions, handle = response.functions, response.service.handle
        with handle:
            raw = self._written(response.message, functions)
            try:
                # an older error of this thread would be reported with this one
                self._reset_error()
                result = self._send(handle.pointer, response.header.request, raw)
            finally:
                functions.destroy(raw)
            self._succeeded(result, 'send response')

    def _written(self, message: Any, functions: _Functions) -> int:
        """Return an answer in C; many equal entries are copied from one."""
        field, entries = _crowd(message)
        if not field:
            return _in_c(message, functions)
        raw, one = functions.create(), _in_c(type(message)(**{field: entries[:1]}), functions)
        try:
            if raw is None or not self._repeat(one, raw, entries):
                raise MemoryError
        except BaseException:
            if raw is not None:
                functions.destroy(raw)
            raise
        finally:
            functions.destroy(one)
        return raw

    def _repeat(self, one: int, many: int, entries: Sequence[Any]) -> bool:
        """Fill a sequence with copies of the one entry of another."""
        kind: Any = type(entries[0])
        name = f'{kind.__module__.partition(".")[0]}__msg__{kind.__name__}'
        if not _RESIZE((f'{name}__Sequence__init', self._library))(many, len(entries)):
            return False
        if entries[0] == kind():
            return True
        copy, size = _COPY((f'{name}__copy', self._library)), layout_of(kind).size
        source, target = _WORD.from_address(one).value, _WORD.from_address(many).value
        return all(copy(source, target + place * size) for place in range(len(entries)))

    def _succeeded(self, result: int, what: str) -> None:
        if result == RCL_RET_OK:
            return
        text = self._get_error().str.decode(errors='replace')
        self._reset_error()
        if result == RCL_RET_TIMEOUT:
            raise Unreachable(text)
        raise RCLError(f'failed to {what}: {text}')

    def _functions_of(self, kind: Any) -> _Functions:
        found = self._functions.get(kind)
        if found is None:
            found = self._functions[kind] = _Functions(
                _CREATE(_address(kind, '_CREATE_ROS_MESSAGE')),
                _TO_C(_address(kind, '_CONVERT_FROM_PY')),
                _TO_PYTHON(_address(kind, '_CONVERT_TO_PY')),
                _DESTROY(_address(kind, '_DESTROY_ROS_MESSAGE')))
        return found


def _address(kind: Any, name: str) -> int:
    """Return the address of a function that a message class carries."""
    try:
        capsule = getattr(type(kind), name)
        return int(_capsule_pointer(capsule, _capsule_name(capsule)))
    except (AttributeError, ValueError) as error:   # ValueError: not a capsule
        raise Unfit(f'{kind.__name__}.{name}: {error}') from None


def _in_c(message: Any, functions: _Functions) -> int:
    raw = functions.create()
    if raw is None:
        raise MemoryError
    if not functions.to_c(message, raw):
        functions.destroy(raw)
        raise TypeError(f'{type(message).__name__} cannot be converted')
    return raw


def _read(raw: int, layout: MessageLayout, functions: _Functions) -> Any:
    """Return a request in Python, but for what is too long in it."""
    count = cut(raw, layout)
    request = functions.to_python(raw)
    if count:
        for field in request.__slots__:
            entries = getattr(request, field)
            if isinstance(entries, list) and len(entries) == 1:
                setattr(request, field, entries * count)
    return request


def _crowd(message: Any) -> tuple[str, Sequence[Any]]:
    """Return the one field of a message, if it has very many equal entries; else ''."""
    fields = list(message.get_fields_and_field_types())
    entries = getattr(message, fields[0]) if len(fields) == 1 else ()
    if (isinstance(entries, list) and len(entries) > ENTRIES_MAX
            and all(map(is_, entries, repeat(entries[0])))):
        return fields[0], entries
    return '', ()


def take_by_rclpy(service: Service) -> tuple[Any, Any] | None:
    """Return a request as the executors of rclpy take it, with the interpreter held."""
    kind: Any = service.srv_type
    handle: Any = service.handle
    request, header = handle.service_take_request(kind.Request)
    return None if header is None else (request, header)
