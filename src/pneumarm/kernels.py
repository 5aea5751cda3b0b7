"""How pneumarm compiles its hot loops: with Numba, by its documented interface, and a cache that is never stale.

Numba keeps a compiled function beside its source file and forgets it when that file changes. It does not see a
change in a function of *another* file that the first one calls. So kernels are compiled from a copy of their source
in the cache folder, whose name holds a hash of all sources that compile anything: any change starts a fresh folder.

Numba's settings, and what others compile in the same process, stay as they are.
"""

import atexit
import functools
import getpass
import hashlib
import os
import shutil
import stat
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

import numba
import numpy as np
import platformdirs
from llvmlite import ir
from numba.extending import intrinsic, typeof_impl

njit: Any = numba.njit
_Function = TypeVar("_Function", bound=Callable[..., Any])
INNER: Any = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": False,
    "forceinline": False,
    "no_cfunc_wrapper": True,
}
"""Options of Numba's for all that is compiled: without Python's lock, and with NumPy's rules of division, because a
check for zero alone keeps a loop with a rational function in it from being vectorised. What is not said here would be
as in the caller that happens to be compiled first."""
PART: Any = {**INNER, "forceinline": True}
"""... for a :func:`part`, and for what is one by the types of its arguments (``numba.extending.overload``)."""
_KEEP = 3  # folders of earlier sources kept, so that switching back and forth does not recompile
_PACKAGE = Path(__file__).parent


def sources_hash(package: Path) -> str:
    """Return a hash of all kernel sources below ``package`` and of Numba's version.

    A kernel source is a file that names this module: it jits functions, or is called by those that do.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        if b"pneumarm.kernels" in source:
            digest.update(path.relative_to(package).as_posix().encode() + b"\0" + source + b"\0")
    return digest.hexdigest()[:16]


def _cache_root() -> Path:
    base = os.environ.get("PNEUMARM_CACHE")
    if base:
        return Path(base)
    return platformdirs.user_cache_path("pneumarm", appauthor=False)


def _own_folder() -> Path:
    """Return a folder among the temporary files that nobody else can write to: what lies in a cache is executed."""
    whose = os.getuid() if hasattr(os, "getuid") else getpass.getuser()
    folder = Path(tempfile.gettempdir()) / f"pneumarm-{whose}"
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    known = folder.lstat()
    if stat.S_ISDIR(known.st_mode) and (os.name == "nt" or (known.st_uid == whose and not known.st_mode & 0o022)):
        return folder
    folder = Path(tempfile.mkdtemp(prefix="pneumarm-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _cache_folder() -> Path:
    name = sources_hash(_PACKAGE)
    for choose in (_cache_root, _own_folder):
        try:
            root = choose()
            folder = root / name
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            os.utime(folder)
            _forget_old(root)
            _forget_empty(folder)
            return folder
    raise OSError("no folder to keep compiled kernels in: set PNEUMARM_CACHE to a writable folder")


def _forget_old(root: Path) -> None:
    folders = sorted((f for f in root.iterdir() if f.is_dir()), key=lambda f: f.stat().st_mtime)
    for folder in folders[:-_KEEP]:
        shutil.rmtree(folder, ignore_errors=True)


def _forget_empty(folder: Path) -> None:
    """Remove files without contents, as a power cut leaves them: Numba would stop at one."""
    for file in folder.rglob("*"):
        with suppress(OSError):
            if file.is_file() and not file.stat().st_size:
                file.unlink()


CACHE_FOLDER = _cache_folder()
"""Where the kernels of these sources are."""


@functools.cache
def _copied(source: str) -> str | None:
    """Return the path of the copy of ``source`` in the cache folder; None for a file outside the package."""
    path = Path(source)
    if not path.is_relative_to(_PACKAGE):
        return None
    copy = CACHE_FOLDER / path.relative_to(_PACKAGE)
    if not copy.exists():
        copy.parent.mkdir(parents=True, exist_ok=True)
        unfinished = copy.with_name(f".{copy.name}.{os.getpid()}")
        shutil.copy2(path, unfinished)  # with its time, so that whoever copies it last changes nothing
        os.replace(unfinished, copy)
    return str(copy)


def kernel(function: _Function | None = None, **options: Any) -> Any:
    """Compile ``function`` with Numba in no-Python mode, without the GIL, cached across processes.

    Options are passed on to ``numba.njit``.
    """

    def compile_(f: Any) -> Any:
        copy = _copied(f.__code__.co_filename)
        if copy is not None:
            code = f.__code__.replace(co_filename=copy)
            f = functools.update_wrapper(FunctionType(code, f.__globals__, closure=f.__closure__), f)
        return numba.njit(**{**INNER, "cache": copy is not None, **options})(f)

    return compile_ if function is None else compile_(function)


def inner(function: _Function | None = None, **options: Any) -> Any:
    """Compile ``function`` into the kernels that call it; as a kernel of its own, with an entry, if Python does, too.

    It is compiled once for each kind of arguments.
    """
    return _for_kernels(function, {**INNER, **options})


def part(function: _Function | None = None, *, entry: bool = False, **options: Any) -> Any:
    """Compile ``function`` as a part of hot loops: as :func:`inner`, but made to vanish in its caller.

    Parts take their arguments as named tuples of arrays, which take longer to pass on than a small network takes to
    compute. One that Python calls often needs an ``entry``: then it is a kernel, for kernels as well.
    """
    if entry:
        return kernel(function, **{**PART, **options})
    return _for_kernels(function, {**PART, **options})


def _for_kernels(function: _Function | None, options: dict[str, Any]) -> Any:
    def compile_(f: Any) -> Any:
        return _ForKernels(f, options)

    return compile_ if function is None else compile_(function)


class _ForKernels:
    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func, self._options = function, options
        self.compiled = njit(**options, no_cpython_wrapper=True)(function)

    @functools.cached_property
    def _entry(self) -> Any:
        return kernel(self.py_func, **self._options)

    def __call__(self, *arguments: Any) -> Any:
        return self._entry(*arguments)


@typeof_impl.register(_ForKernels)
def _as_compiled(function: _ForKernels, _: object) -> Any:
    return numba.typeof(function.compiled)


_OWNER, _PARENT, _DATA, _FIELDS = 0, 1, 4, 7
"""Places in what Numba makes of an array: memory, size, where the numbers lie, shape and strides."""


def without_owner(builder: Any, kind: Any, value: Any) -> Any:
    """Return ``value`` of Numba's type ``kind`` with arrays that belong to nobody, while code is made."""
    if isinstance(kind, numba.types.Array):
        for place in (_OWNER, _PARENT):
            value = builder.insert_value(value, ir.Constant(value.type.elements[place], None), place)
    elif isinstance(kind, numba.types.BaseTuple):
        for place, item in enumerate(cast("Any", kind)):
            lent = without_owner(builder, item, builder.extract_value(value, place))
            value = builder.insert_value(value, lent, place)
    return value


def floats_of(builder: Any, array: Any) -> Any:
    """Return where the float32 numbers of ``array`` begin, while code is made."""
    if len(array.type.elements) != _FIELDS:
        raise NotImplementedError("this version of Numba has other arrays")
    return builder.bitcast(builder.extract_value(array, _DATA), ir.FloatType().as_pointer())


@intrinsic
def _lent(_: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return without_owner(builder, value, args[0])

    return value(value), generate


@intrinsic
def _last(_: Any, array: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(builder.gep(floats_of(builder, args[0]), [ir.Constant(ir.IntType(64), 2)]))

    return numba.types.float32(array), generate


@kernel
def _tried(value):  # type: ignore[no-untyped-def]
    lent: Any = _lent(value)  # type: ignore[call-arg]
    return _last(lent[0]) + lent[1].sum()


def _is_extended() -> bool:
    try:
        return bool(_tried((np.arange(3, dtype=np.float32), np.ones(2))) == 4.0)
    except Exception:
        return False


EXTENDED = _is_extended()
"""Whether code made by hand is right with this version of Numba, as tried here; else loops are plain and slower."""


def _same(value):  # type: ignore[no-untyped-def]
    return value


borrowed: Any = _lent if EXTENDED else inner(_same)
"""Return, in a kernel, its argument, arrays or tuples of arrays, without counting references to them.

A loop that passes named tuples of arrays from part to part would count references all the time, which takes longer
than a small network. What Python hands over lives until the kernel returns; so a kernel may borrow its arguments in
its first line, unless it returns them or parts of them.
"""


def direct(compiled: Any) -> Any:
    """Return a kernel for calls whose arguments are always of the types of the first call.

    Numba looks at the types of all arguments in every call, 2 to 3 µs for a named tuple of arrays; this does so once.
    """
    entry: Any = None

    def call(*arguments: Any) -> Any:
        nonlocal entry
        if entry is None:
            entry = compiled.compile(tuple(numba.typeof(argument) for argument in arguments))
        return entry(*arguments)

    return call if hasattr(compiled, "compile") else compiled
