"""Machine code for kernels, compiled for this processor once and then kept on disk."""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
import tempfile
import threading
from functools import cache
from pathlib import Path
from typing import Any

_LOCK = threading.Lock()  # LLVM's compiler serves one thread at a time


class MachineCode:
    """A compiled kernel.

    Parameters
    ----------
    assembly : str
        LLVM assembly that defines ``@kernel``.
    """

    def __init__(self, assembly: str) -> None:
        with _LOCK:
            llvm = _llvm()
            machine = llvm.Target.from_default_triple().create_target_machine(
                cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2, jit=True
            )
            made_for = f"{llvm.llvm_version_info} {machine.triple} {_processor()}"
            key = hashlib.sha256(f"{made_for}\n{assembly}".encode()).hexdigest()
            kept = cache_folder() / f"{key}.o"
            if kept.is_file():
                code = kept.read_bytes()
            else:
                code = machine.emit_object(llvm.parse_assembly(assembly))
                _keep(kept, code)
            # The engine owns the machine from here on: another one needs its own.
            self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
            self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
            self._engine.finalize_object()
            address = self._engine.get_function_address("kernel")
        signature = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)
        self.call = signature(address)


def cache_folder() -> Path:
    """Where compiled kernels are kept: $GONIOMETER_CACHE_DIR, or the user's own cache folder."""
    given = os.environ.get("GONIOMETER_CACHE_DIR")
    if given:
        return Path(given)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "goniometer" / "kernels"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "goniometer" / "kernels"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "goniometer" / "kernels"


def _keep(path: Path, code: bytes) -> None:
    # Code that is run again belongs to this user alone. Without a place to keep it, it is compiled anew next time.
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(code)
        Path(file.name).replace(path)
    except OSError:
        return


@cache
def _llvm() -> Any:
    import llvmlite.binding as llvm  # loads LLVM, which is only needed when something is computed

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


@cache
def _processor() -> str:
    llvm = _llvm()
    return f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
