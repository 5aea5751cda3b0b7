"""Curves of a training for TensorBoard, while it goes on."""

from pathlib import Path
from types import TracebackType
from typing import Self

from pneumarm.errors import UnusableInput
from pneumarm.extras import extra
from pneumarm.learning.training import Progress, Training


class Scalars:
    """Writes every row of the learners' curves once: a scalar a column, by the episodes of its learner."""

    def __init__(self, folder: Path) -> None:
        """Write into ``folder``, which is made if there is none; each learner gets a folder in it.

        Raises:
            UnusableInput: tensorboardX is not installed, or the folder cannot be made.

        """
        self._open = extra("tensorboardX", "tensorboard", "--tensorboard").SummaryWriter
        self._folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UnusableInput(f"{folder}: expected a folder for curves ({error.strerror})") from error
        self._writers: list[object] = []
        self._written: list[int] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for writer in self._writers:
            writer.close()  # type: ignore[attr-defined]

    def write(self, now: Progress | Training[object]) -> None:
        """Write the rows that there were not at the last call."""
        for number, curve in enumerate(now.curves):
            if number == len(self._writers):
                self._writers.append(self._open(str(self._folder / f"agent-{number + 1}"), flush_secs=5))
                self._written.append(0)
            writer = self._writers[number]
            for row in curve[self._written[number] :]:
                for column, value in zip(now.columns[1:], row[1:], strict=True):
                    writer.add_scalar(column, float(value), int(row[0]))  # type: ignore[attr-defined]
            self._written[number] = len(curve)
