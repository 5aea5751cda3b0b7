"""Arms behind a microcontroller: the protocol, the link, the driver, and a board in pure Python to try them on."""

from pneumarm.arm.serial.arm import SerialArm
from pneumarm.arm.serial.board import BoardLine, EmulatedBoard
from pneumarm.arm.serial.line import Line
from pneumarm.arm.serial.line_faults import FaultyLine, LineFaults

__all__ = ["BoardLine", "EmulatedBoard", "FaultyLine", "Line", "LineFaults", "SerialArm"]
