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

_DIGEST_BYTES = 32
_LOCK = threading.Lock()  # LLVM's compiler serves one thread at a time


class MachineCode:
    """A compiled kernel.

    Parameters
    ----------
    assembly : str
        LLVM assembly that defines ``@repeated``.
    """

    def __init__(self, assembly: str) -> None:
        with _LOCK:
            llvm = _llvm()
            machine = llvm.Target.from_default_triple().create_target_machine(
                cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2, jit=True
            )
            made_for = f"{llvm.llvm_version_info} {machine.triple} {_processor()}"
            key = hashlib.sha256(f"{made_for}\n{assembly}".encode()).hexdigest()
            code = _kept(key)
            if code is None:
                code = machine.emit_object(llvm.parse_assembly(assembly))
                _keep(key, code)
            # The engine owns the machine from here on: another one needs its own.
            self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
            self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
            self._engine.finalize_object()
            address = self._engine.get_function_address("repeated")
        number, pointer = ctypes.c_int64, ctypes.c_void_p
        signature = ctypes.CFUNCTYPE(None, number, *[pointer] * 4, *[number] * 3)
        self.call = signature(address)


def cache_folder() -> Path:
    """Where compiled kernels are kept: $GONIOMETER_CACHE_DIR, or the user's own cache folder."""
    given = os.environ.get("GONIOMETER_CACHE_DIR")
    if given:
        return Path(given)
    variable, folder = {
        "win32": ("LOCALAPPDATA", "~/AppData/Local"),
        "darwin": ("XDG_CACHE_HOME", "~/Library/Caches"),
    }.get(sys.platform, ("XDG_CACHE_HOME", "~/.cache"))
    return Path(os.environ.get(variable) or folder).expanduser() / "goniometer" / "kernels"


# A cache saves time and nothing else: whatever is wrong with it, the kernel is compiled anew.


def _kept(key: str) -> bytes | None:
    try:
        content = (cache_folder() / f"{key}.kernel").read_bytes()
    except (OSError, RuntimeError):  # RuntimeError: this user has no home
        return None
    digest, code = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
    return code if digest == hashlib.sha256(code).digest() else None


def _keep(key: str, code: bytes) -> None:
    try:
        folder = cache_folder()
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        # Whole or not at all, though several processes may write it at once.
        with tempfile.TemporaryDirectory(dir=folder) as nook:
            part = Path(nook) / key
            part.write_bytes(hashlib.sha256(code).digest() + code)
            part.replace(folder / f"{key}.kernel")
    except (OSError, RuntimeError):
        return


if hasattr(os, "register_at_fork"):
    # No process is forked while a thread holds it that the new process would not have.
    os.register_at_fork(before=_LOCK.acquire, after_in_parent=_LOCK.release, after_in_child=_LOCK.release)


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
