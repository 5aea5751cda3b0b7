"""How pneumarm compiles its hot loops: one decorator, and a cache that cannot serve stale or broken code.

Four traps of Numba are closed here:

1. It does not see a change in a jitted function of *another* file. So the cache folder's name holds a hash
   of every source file that compiles anything and of Numba's version: any change starts a fresh folder.
2. A truncated entry makes it crash. Here an entry that cannot be read is dropped and compiled again.
3. A kernel's machine code holds copies of the kernels that it calls, optimised once more than the originals, so that
   sums may run in another order. Numba lets a process call whichever it has loaded first, and results would depend
   on what it has compiled or called before. Here every kernel calls its own copies.
4. It numbers functions in each process, and links by names and numbers. Two that one factory made in two processes,
   one of them come by way of the cache, could have the same number, and one would be called for both. Here each
   process begins at a number of its own.

What a kernel calls is compiled as code alone, and becomes machine code in its callers: a kernel that Python calls as
well is compiled twice, as code for kernels and with an entry for Python. With machine code of each, a first run
compiled for half as long again. LLVM optimises at its first level, which makes loops as fast as the third does here
(``python -m benchmarks`` with ``NUMBA_OPT=3`` shows it) in four fifths of the time.
"""

import atexit
import gc
import getpass
import hashlib
import itertools
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import llvmlite.binding as llvm
import numba
import numba.extending
import platformdirs
from numba.core import event
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.dispatcher import Dispatcher
from numba.core.environment import lookup_environment
from numba.core.registry import cpu_target
from numba.np import arrayobj

numba_config: Any = numba.config
_Function = TypeVar("_Function", bound=Callable[..., Any])
KERNEL: Any = {"nogil": True, "error_model": "numpy", "_nrt": True, "no_cfunc_wrapper": True}
"""Options of Numba's for a :func:`kernel`."""
INNER: Any = {**KERNEL, "no_cpython_wrapper": True}
"""... for an :func:`inner` one."""
PART: Any = {**INNER, "_nrt": False, "forceinline": True}
"""... for a :func:`part`, and for what is one by the types of its arguments (``numba.extending.overload``)."""
_OBJECTS = 200_000
"""So many new ones make Python look for garbage while Numba compiles, which keeps nearly all that it makes; with the
usual 700 that took a twelfth of the time."""
_KEEP = 3  # folders of earlier sources kept, so that switching back and forth does not recompile


def sources_hash(package: Path) -> str:
    """Return a hash of all kernel sources below ``package``, of Numba's version and of how well it optimises.

    A kernel source is a file that names this module: it jits functions, or is called by those that do.
    """
    digest = hashlib.sha256(f"{numba.__version__} {numba_config.OPT!r}".encode())
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
    name = sources_hash(Path(__file__).parent)
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
            return folder
    raise OSError("no folder to keep compiled kernels in: set PNEUMARM_CACHE to a writable folder")


def _forget_old(root: Path) -> None:
    folders = sorted((f for f in root.iterdir() if f.is_dir()), key=lambda f: f.stat().st_mtime)
    for folder in folders[:-_KEEP]:
        shutil.rmtree(folder, ignore_errors=True)


if "NUMBA_OPT" not in os.environ:
    numba_config.OPT = type(numba_config.OPT)(1)
CACHE_FOLDER = _cache_folder()
"""Where the kernels of these sources are."""
numba_config.CACHE_DIR = str(CACHE_FOLDER)


class _OwnCopies(JITCodeLibrary):
    """A kernel's code with copies of all that it calls; machine code once an address in it is asked for."""

    _bitcode: bytes
    _is_machine_code = False

    def finalize(self) -> None:
        """Link what is called."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._final_module.verify()
        self._bitcode = self._final_module.as_bitcode()
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """Return the code for callers, as it comes from the cache, too: then theirs is the same."""
        self._ensure_finalized()
        if self._shared_module is None:
            self._shared_module = llvm.parse_bitcode(self._bitcode)
            for function in self._shared_module.functions:
                if not function.is_declaration and function.linkage == llvm.Linkage.external:
                    function.linkage = "linkonce_odr"
        return self._shared_module

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of ``name``, 0 where it is not defined here."""
        self._ensure_finalized()
        if not self._is_machine_code and name in self._defined():
            self._make_machine_code()
        return int(super().get_pointer_to_function(name))

    def _defined(self) -> set[str]:
        module = self._final_module
        return {one.name for one in (*module.functions, *module.global_variables) if not one.is_declaration}

    def _make_machine_code(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = "internal"  # never those of another kernel
        self._optimize_final_module()
        self._final_module.verify()
        self._finalize_final_module()
        self._is_machine_code = True
        for variable in self._final_module.global_variables:
            if (environment := lookup_environment(variable.name)) is not None:
                _set_env(variable.name, environment)

    def serialize_using_object_code(self) -> tuple[str, str, Any]:
        """Return what the cache keeps."""
        self._ensure_finalized()
        machine_code = (self._get_compiled_object(), self._defined()) if self._is_machine_code else None
        return self.name, "own copies", (machine_code, self._bitcode)

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> Any:
        name, _, (machine_code, bitcode) = state
        library = codegen.create_library(name)
        library._bitcode, library._finalized = bitcode, True
        if machine_code is not None:
            compiled, defined = machine_code
            library.enable_object_caching()
            library._set_compiled_object(compiled)
            library._finalize_final_module()
            library._is_machine_code = True
            codegen._engine._defined_symbols.update(defined)
        return library


_codegen: Any = cpu_target.target_context.codegen()
_codegen._library_class = _OwnCopies


def _set_env(name: str, environment: Any) -> None:
    """Tell machine code where its globals in Python are; what is code alone has nowhere to keep it."""
    if _codegen._engine.is_symbol_defined(name):
        JITCPUCodegen.set_env(_codegen, name, environment)


_codegen.set_env = _set_env
FunctionIdentity._unique_ids = itertools.count(secrets.randbits(48))


def _refuse_sizes(given: Any, place: Any) -> None:
    """Refuse an array that does not fit into the slice it is assigned to; as Numba does where it knows no texts.

    With a message that names the sizes, each kernel that assigns to a slice holds all that texts are made with.
    """


@numba.extending.overload(_refuse_sizes)
def _refuse_sizes_in_kernels(given: Any, place: Any) -> Callable[[Any, Any], None]:
    def refuse(given: Any, place: Any) -> None:
        raise ValueError("an array of another size is assigned to a slice")

    return refuse


arrayobj.raise_with_shape_context = _refuse_sizes


class _SeldomCollecting(event.Listener):
    """Has Python look for garbage less often while anything is compiled."""

    def __init__(self) -> None:
        self._before: list[tuple[int, int, int]] = []  # of each that is being compiled

    def on_start(self, event: Any) -> None:
        self._before.append(gc.get_threshold())
        gc.set_threshold(_OBJECTS)

    def on_end(self, event: Any) -> None:
        gc.set_threshold(*self._before.pop())


event.register("numba:compile", _SeldomCollecting())


class _ForgivingCache(FunctionCache):
    """Numba's function cache, except that an entry that cannot be read is compiled again."""

    def __init__(self, function: Any, prefix: str) -> None:
        super().__init__(function)
        base = f"{prefix}{self._impl.filename_base}"
        self._cache_file = IndexDataCacheFile(self._cache_path, base, self._impl.locator.get_source_stamp())

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

    Nothing here is called as a C function, so no kernel gets the entry for that.
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
            dispatcher._cache = _ForgivingCache(f, "")
            if not settings.get("no_cpython_wrapper"):
                for_kernels = numba.njit(**{**settings, "no_cpython_wrapper": True})(f)
                for_kernels._cache = _ForgivingCache(f, "for-kernels-")
                dispatcher.get_call_template = for_kernels.get_call_template
                dispatcher.get_overload = for_kernels.get_overload
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
