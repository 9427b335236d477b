"""Flushes denormal numbers to zero: they are too small for float32's full precision, and slow on some processors.

A network trained with weight decay may have thousands of such weights (11 % of TwinLiteNet's), which produce more of
them in its activations. Some processors compute with them a hundred times slower. Replacing them by zero changes no
output by more than 1e-38 per term.
"""

from __future__ import annotations

import ctypes
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np
import onnx
from onnx import numpy_helper

_X86 = ("x86_64", "AMD64")
_FLUSH_X86 = 0x8040
"""Bits FTZ and DAZ of the register MXCSR."""
_MXCSR = 7
"""Its index in ``fenv_t``, in 32-bit words: 28 bytes of x87 state come before it (glibc and musl)."""
_FLUSH_ARM = 1 << 24
"""Bit FZ of the register FPCR, the first word of ``fenv_t`` (glibc and musl on aarch64)."""
_FENV_WORDS = 16
"""More than ``fenv_t`` takes on any platform here."""


def flush_weights(model: onnx.ModelProto) -> int:
    """Set each denormal float32 weight of a graph to zero, in place; returns how many."""
    smallest, flushed = np.finfo(np.float32).tiny, 0
    for tensor in model.graph.initializer:
        if tensor.data_type != onnx.TensorProto.FLOAT or tensor.data_location == onnx.TensorProto.EXTERNAL:
            continue
        weights = numpy_helper.to_array(tensor)
        denormal = (weights != 0.0) & (np.abs(weights) < smallest)
        if denormal.any():
            flushed += int(denormal.sum())
            tensor.CopyFrom(numpy_helper.from_array(np.where(denormal, np.float32(0.0), weights), tensor.name))
    return flushed


@contextmanager
def flush_to_zero() -> Iterator[None]:
    """Denormal results are flushed to zero on this thread during the block. onnxruntime's ``set_denormal_as_zero``
    affects only its own threads, but the calling thread does part of the computation. No effect on unknown systems."""
    word = _control_word()
    if word is None:
        yield
        return
    place, bits = word
    before = (ctypes.c_uint32 * _FENV_WORDS)()
    libm = _libm()
    libm.fegetenv(before)
    changed = (ctypes.c_uint32 * _FENV_WORDS)(*before)
    changed[place] |= bits
    libm.fesetenv(changed)
    try:
        yield
    finally:
        libm.fesetenv(before)


@cache
def _control_word() -> tuple[int, int] | None:
    """The word of ``fenv_t`` with the bits, and the bits; None if unknown."""
    if sys.platform != "linux":
        return None
    return {**dict.fromkeys(_X86, (_MXCSR, _FLUSH_X86)), "aarch64": (0, _FLUSH_ARM)}.get(platform.machine())


@cache
def _libm() -> ctypes.CDLL:
    # PyDLL keeps the interpreter lock: releasing it would cost more than the two instructions
    return ctypes.PyDLL("libm.so.6")
