import pytest

from tests.firmware.build import missing


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if lacks := missing():
        terminalreporter.write_line(f"NOT TESTED: the firmware in its simulated microcontroller. {lacks}", red=True)
