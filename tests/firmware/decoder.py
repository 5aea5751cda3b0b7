"""The firmware's frames, compiled for this machine: what a million of them need."""

import ctypes
from collections.abc import Iterator

from tests.firmware.build import decoder
from tests.firmware.wire import CONSTANT

NONE, TAKEN, CORRUPT = range(3)
_LONGEST = CONSTANT["LONGEST_FRAME"]
_Out = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_uint8), ctypes.c_uint8)


class _Receiver(ctypes.Structure):
    _fields_ = (("bytes", ctypes.c_uint8 * _LONGEST), ("length", ctypes.c_uint8))


class _Sender(ctypes.Structure):
    _fields_ = (
        ("block", ctypes.c_uint8 * _LONGEST),
        ("length", ctypes.c_uint8),
        ("crc", ctypes.c_uint16),
        ("out", _Out),
    )


class Frames:
    """The functions of ``frame.c``."""

    def __init__(self) -> None:
        self._c = ctypes.CDLL(str(decoder()))
        self._c.crc16.argtypes = [ctypes.c_char_p, ctypes.c_uint8]
        self._c.crc16.restype = ctypes.c_uint16
        self._c.cobs_decode.argtypes = [ctypes.POINTER(ctypes.c_uint8), ctypes.c_uint8]
        self._c.cobs_decode.restype = ctypes.c_uint8
        self._c.frame_receive.argtypes = [ctypes.POINTER(_Receiver), ctypes.c_uint8]
        self._receiver = _Receiver()

    def crc(self, data: bytes) -> int:
        """Return CRC-16/X-25 as the firmware computes it."""
        return int(self._c.crc16(data, len(data)))

    def cobs_decode(self, data: bytes) -> bytes:
        """Return what ``data`` decodes to; empty where it is no COBS."""
        buffer = (ctypes.c_uint8 * max(len(data), 1))(*data)
        length = self._c.cobs_decode(buffer, len(data))
        return bytes(buffer)[:length]

    def receive(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Yield what ends in ``data``: TAKEN and the frame's first bytes, its content among them, or CORRUPT."""
        for byte in data:
            event = self._c.frame_receive(ctypes.byref(self._receiver), byte)
            if event != NONE:
                yield event, bytes(self._receiver.bytes)

    def send(self, content: bytes) -> bytes:
        """Return the frame that the firmware sends for ``content``."""
        frame = bytearray()
        sender = _Sender()
        out = _Out(lambda block, length: frame.extend(block[:length]))
        self._c.frame_begin(ctypes.byref(sender), out)
        for byte in content:
            self._c.frame_put(ctypes.byref(sender), byte)
        self._c.frame_end(ctypes.byref(sender))
        return bytes(frame)
