"""How pneumarm compiles its hot loops: one decorator, and a cache that cannot serve stale or broken code.

Three traps of Numba are closed here:

1. It does not see a change in a jitted function of *another* file. So the cache folder's name holds a hash
   of every source file that compiles anything and of Numba's version: any change starts a fresh folder.
2. A truncated entry makes it crash. Here an entry that cannot be read is dropped and compiled again.
3. A kernel's machine code holds copies of the kernels that it calls, optimised with it, so that sums may run in
   another order than in the originals. Numba lets a process call whichever it has loaded first, and results would
   depend on what it has compiled or called before. Here every kernel calls its own copies.

And one cost: Numba makes machine code, wrappers for Python and a cache entry of every kernel, also of those that only
other kernels call, and optimises these once more in each caller. Here a kernel is compiled for Python when Python
calls it; for kernels that call it there is only its code, which is optimised once, as a part of what Python calls.
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
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher, _FunctionCompiler  # type: ignore[attr-defined]
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.sigutils import normalize_signature
from numba.core.typing.templates import make_concrete_template

_Function = TypeVar("_Function", bound=Callable[..., Any])
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


class _Library(JITCodeLibrary):
    """The machine code of what is called from Python, or the code of a kernel as other kernels call it.

    The former is linked with its own copies of all kernels that it calls, and optimised as a whole. The latter is
    neither linked nor optimised nor made machine code.
    """

    def add_linking_library(self, library: Any) -> None:
        self._linking_libraries.append(library)

    def _get_module_for_linking(self) -> Any:
        if self._finalized:
            return super()._get_module_for_linking()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        return self._final_module

    def get_pointer_to_function(self, name: str) -> Any:
        if not self._finalized and all(function.name != name for function in self._final_module.functions):
            return 0  # it is not called from Python
        return super().get_pointer_to_function(name)

    def finalize(self) -> None:
        called: dict[Any, None] = {}
        waiting = list(self._linking_libraries)
        while waiting:
            library = waiting.pop(0)
            if library not in called:
                called[library] = None
                waiting += [] if library._finalized else library._linking_libraries
        self._linking_libraries = list(called)
        super().finalize()
        for variable in self._final_module.global_variables:
            if (environment := lookup_environment(variable.name)) is not None:
                self._codegen.set_env(variable.name, environment)  # type: ignore[attr-defined]

    def _optimize_final_module(self) -> None:
        super()._optimize_final_module()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = "internal"


class _Codegen(JITCPUCodegen):
    """Numba's, which has nowhere to put the environment of what has no machine code."""

    _library_class = _Library

    def set_env(self, env_name: str, env: Any) -> None:
        if self._engine.get_global_value_address(env_name):
            super().set_env(env_name, env)


cpu_target.target_context.codegen().__class__ = _Codegen


class _InlinedCompiler(_FunctionCompiler):  # type: ignore[misc]
    """Compiles a kernel for the calls of other kernels: without what calls from Python need."""

    def _customize_flags(self, flags: Any) -> Any:
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        return flags


class _Kernel(CPUDispatcher):
    """A jitted function that is compiled once more, and otherwise, for the kernels that call it."""

    _compiler: Any
    _cache: Any

    def __init__(self, function: Callable[..., Any], *args: Any, **kwargs: Any) -> None:
        super().__init__(function, *args, **kwargs)
        own = self._compiler
        self._for_kernels = _InlinedCompiler(
            function, own.targetdescr, own.targetoptions, own.locals, own.pipeline_class
        )
        self._inlined: dict[Any, Any] = {}

    def get_call_template(self, args: Any, kws: Any) -> Any:
        signature, args = self._compiler.fold_argument_types(args, kws)
        if args not in self._inlined:
            with global_compiler_lock, self._compiling_counter:
                self._inlined[args] = _without_notes(self._for_kernels.compile(args, None))
        name = f"CallTemplate({self.py_func.__name__})"
        signatures = [compiled.signature for compiled in self._inlined.values()]
        return make_concrete_template(name, key=self.py_func.__name__, signatures=signatures), signature, args, {}

    def add_overload(self, cres: Any) -> None:
        super().add_overload(_without_notes(cres))

    def get_overload(self, sig: Any) -> Any:
        return self._inlined[normalize_signature(sig)[0]].entry_point


def _without_notes(compiled: Any) -> Any:
    """Return what was ``compiled`` without what the compiler noted of it on the way, which takes most memory."""
    compiled.fndesc.typemap = compiled.fndesc.calltypes = None
    return compiled._replace(type_annotation=None, metadata=None, call_helper=None)


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
    """

    def compile_(f: _Function) -> Any:
        if getattr(numba_config, "DISABLE_JIT", 0):
            return f
        settings = {"nopython": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}
        dispatcher = _Kernel(f, targetoptions=settings)
        dispatcher._cache = _ForgivingCache(f)
        return dispatcher

    return compile_ if function is None else compile_(function)


def part(function: _Function | None = None, **options: Any) -> Any:
    """Compile ``function`` as a part of hot loops: as :func:`kernel`, but made to vanish in its caller.

    Parts take their arguments as named tuples of arrays. Passed in the usual way each of these arrays is copied word
    by word and its references are counted, which takes longer than a small network; a part is always inlined
    and counts no references. So it must not make arrays, nor assign to slices; Numba says so if it does.
    """
    return kernel(function, **{"_nrt": False, "forceinline": True, **options})


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
