"""How pneumarm compiles its hot loops: one decorator, and a cache that cannot serve stale or broken code.

Three traps of Numba are closed here:

1. It does not see a change in a jitted function of *another* file. So the cache folder's name holds a hash
   of every source file that compiles anything and of Numba's version: any change starts a fresh folder.
2. A truncated entry makes it crash. Here an entry that cannot be read is dropped and compiled again.
3. A kernel's machine code holds copies of the kernels that it calls, optimised once more than the originals, so that
   sums may run in another order. Numba lets a process call whichever it has loaded first, and results would depend
   on what it has compiled or called before. Here every kernel calls its own copies.
"""

import getpass
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import llvmlite.binding as llvm
import numba
import platformdirs
from numba import config as numba_config
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.dispatcher import Dispatcher
from numba.core.registry import cpu_target

_Function = TypeVar("_Function", bound=Callable[..., Any])
KERNEL: Any = {"nogil": True, "error_model": "numpy", "_nrt": True, "no_cfunc_wrapper": True}
"""Options of Numba's for a :func:`kernel`."""
INNER: Any = {**KERNEL, "no_cpython_wrapper": True}
"""... for an :func:`inner` one."""
PART: Any = {**INNER, "_nrt": False, "forceinline": True}
"""... for a :func:`part`, and for what is one by the types of its arguments (``numba.extending.overload``)."""
_KEEP = 3  # folders of earlier sources kept, so that switching back and forth does not recompile


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


def _cache_folder() -> Path:
    name = sources_hash(Path(__file__).parent)
    whose = os.getuid() if hasattr(os, "getuid") else getpass.getuser()
    for root in (_cache_root(), Path(tempfile.gettempdir()) / f"pneumarm-{whose}"):
        folder = root / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            os.utime(folder)
            _forget_old(root)
            return folder
    raise OSError("no folder to keep compiled kernels in: set PNEUMARM_CACHE to a writable folder")


def _forget_old(root: Path) -> None:
    folders = sorted((f for f in root.iterdir() if f.is_dir()), key=lambda f: f.stat().st_mtime)
    for folder in folders[:-_KEEP]:
        shutil.rmtree(folder, ignore_errors=True)


CACHE_FOLDER = _cache_folder()
"""Where the kernels of these sources are."""
numba_config.CACHE_DIR = str(CACHE_FOLDER)  # type: ignore[attr-defined]


class _OwnCopies(JITCodeLibrary):
    """A kernel's machine code that calls its own copies of other kernels, whatever the process has loaded before."""

    def _optimize_final_module(self) -> None:
        super()._optimize_final_module()
        # What callers link is as it comes from the cache: then their code is the same too.
        self._shared_module = llvm.parse_bitcode(self._final_module.as_bitcode())
        for function in self._shared_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = "internal"


cpu_target.target_context.codegen()._library_class = _OwnCopies


class _ForgivingCache(FunctionCache):
    """Numba's function cache, except that an entry that cannot be read is compiled again."""

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(signature, target_context)
        except Exception:
            # Whatever a damaged file raises (EOFError, UnpicklingError, ...): forget the whole index.
            self.flush()
            return None

    def save_overload(self, signature: Any, data: Any) -> None:
        try:
            super().save_overload(signature, data)
        except Exception:
            # The index itself can be damaged; caching is a convenience and never an error.
            self.flush()


def kernel(function: _Function | None = None, **options: Any) -> Any:
    """Compile ``function`` with Numba in no-Python mode, without the GIL, cached across processes.

    Division follows NumPy's rules (no check for zero), because that check alone keeps a loop with a
    rational function in it from being vectorised. Options are passed on to ``numba.njit``.

    Nothing here is called as a C function, so no kernel gets the entry for that: each entry is compiled and optimised
    as the kernel itself is, which took a first run a fifth of its time.
    """

    def compile_(f: _Function) -> Any:
        # What is not said of counting references (_nrt) is as in the caller that happens to be compiled first.
        settings = {**KERNEL, **options}
        dispatcher = numba.njit(**settings)(f)
        if getattr(numba_config, "DISABLE_JIT", 0):
            return dispatcher
        if settings.get("no_cpython_wrapper"):
            _refuse_python(dispatcher)
        if settings.get("inline", "never") == "never":
            dispatcher._cache = _ForgivingCache(dispatcher.py_func)
        return dispatcher

    return compile_ if function is None else compile_(function)


def inner(function: _Function | None = None, **options: Any) -> Any:
    """Compile ``function`` as :func:`kernel` does, but for other kernels only: without an entry for Python."""
    return kernel(function, **{**INNER, **options})


def part(function: _Function | None = None, *, entry: bool = False, **options: Any) -> Any:
    """Compile ``function`` as a part of hot loops: as :func:`inner`, but made to vanish in its caller.

    Parts take their arguments as named tuples of arrays. Passed in the usual way each of these arrays is copied word
    by word and its references are counted, which takes longer than a small network; a part is always inlined
    and counts no references. So it must not make arrays, nor assign to slices; Numba says so if it does.

    One that Python calls, too, needs an ``entry``.
    """
    return kernel(function, **{**PART, "no_cpython_wrapper": not entry, **options})


def _refuse_python(dispatcher: Any) -> None:
    """Let Python's calls of a kernel that has no entry for them end in an error, and not in a crash."""
    name = dispatcher.py_func.__qualname__

    def refuse(*_: Any, **__: Any) -> None:
        raise TypeError(f"{name} has no entry for Python: call it from a kernel, or ask for one where it is defined")

    dispatcher._compile_for_args = refuse
    dispatcher._insert = lambda *_: None  # what is not found among those compiled is asked for by the line above


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

    return call if isinstance(compiled, Dispatcher) else compiled
