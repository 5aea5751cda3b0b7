"""Writing a stretch of movement to a file that people show each other: a picture, or one that plays.

What draws with a library is imported where it is needed: a picture that plays is text.
"""

import shutil
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pneumarm.drawing.moving_arm import Shown, moving_arm
from pneumarm.errors import UnusableInput
from pneumarm.files import require_folder, write_text, written_whole

_COLORS = 64  # of a GIF: lines on white
_DPI = 160


def write_view(shown: Shown, path: Path) -> None:
    """Write ``shown`` to ``path``, whose ending says what it becomes.

    Raises:
        UnusableInput: the ending is none of those known, the folder is missing, or there is no ffmpeg for MP4.

    """
    write = check_view(path)
    write(shown, path)


def check_view(path: Path) -> Callable[[Shown, Path], None]:
    """Return what writes to ``path``; raises as :func:`write_view` does, before any work."""
    found = _WRITERS.get(path.suffix.lower())
    if found is None:
        raise UnusableInput(f"{path}: expected a name that ends in {', '.join(_WRITERS)}")
    require_folder(path)
    if found is _mp4 and shutil.which("ffmpeg") is None:
        raise UnusableInput(f"{path}: MP4 needs the program ffmpeg, which is not installed; a GIF needs nothing")
    return found


def _png(shown: Shown, path: Path) -> None:
    from pneumarm.report.figures.film import movement

    with written_whole(path) as temporary:
        movement(shown).savefig(temporary, format="png", dpi=_DPI)


def _svg(shown: Shown, path: Path) -> None:
    write_text(path, moving_arm(shown))


def _gif(shown: Shown, path: Path) -> None:
    from PIL import Image

    from pneumarm.report.figures.film import FRAMES_A_SECOND, frames

    pictures: list[Image.Image] = []
    for frame in frames(shown):  # all with the colours of the first, so that only what moves is stored
        first = pictures[0] if pictures else None
        pictures.append(Image.fromarray(frame).quantize(_COLORS, palette=first, dither=Image.Dither.NONE))
    with written_whole(path) as temporary:
        pictures[0].save(
            temporary,
            format="GIF",
            save_all=True,
            append_images=pictures[1:],
            duration=round(1000 / FRAMES_A_SECOND),
            loop=0,
        )


def _mp4(shown: Shown, path: Path) -> None:
    from pneumarm.report.figures.film import frames

    with written_whole(path) as temporary:
        _encoded(frames(shown), temporary)


def _encoded(pictures: Iterable[NDArray[np.uint8]], path: Path) -> None:
    """Have ffmpeg write ``pictures`` (height, width, 3) to ``path``, in a form that every browser plays."""
    from pneumarm.report.figures.film import FRAMES_A_SECOND

    command: list[str] = []
    process: subprocess.Popen[bytes] | None = None
    for picture in pictures:
        height, width = (2 * (size // 2) for size in picture.shape[:2])  # what the encoder can do
        if process is None:
            source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(FRAMES_A_SECOND)]
            target = ["-pix_fmt", "yuv420p", "-f", "mp4", "-movflags", "+faststart", str(path)]
            command = ["ffmpeg", "-loglevel", "error", "-y", *source, "-i", "-", *target]
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
        assert process.stdin is not None
        try:
            process.stdin.write(picture[:height, :width].tobytes())
        except BrokenPipeError:
            break
    assert process is not None
    _, errors = process.communicate()
    if process.returncode:
        raise UnusableInput(f"ffmpeg could not write the film: {errors.decode(errors='replace').strip()}")


_WRITERS: dict[str, Callable[[Shown, Path], None]] = {".gif": _gif, ".mp4": _mp4, ".png": _png, ".svg": _svg}
"""By the ending of the file."""
