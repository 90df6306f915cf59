"""Other processors, as the variables that make the libraries believe in them."""

from pathlib import Path

NO_VECTORS = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-AVX",
}
MACHINES = {
    "Prescott": {"OPENBLAS_CORETYPE": "Prescott"},
    "SandyBridge": {"OPENBLAS_CORETYPE": "SandyBridge"},
    "Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "Zen": {"OPENBLAS_CORETYPE": "Zen"},
    "SkylakeX": {"OPENBLAS_CORETYPE": "SkylakeX"},
    "no vectors": {"OPENBLAS_CORETYPE": "Prescott", **NO_VECTORS},
    "generic": {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+sse2"},
    "no fused multiply-add": {"NUMBA_CPU_NAME": "x86-64-v2", "NUMBA_CPU_FEATURES": "+sse4.2,+avx,-fma"},
}
"""By name: five sets of BLAS kernels, NumPy and C library without vectors, and two compilers of loops."""


def playable(name: str) -> bool:
    """Whether this processor can run a machine's instructions."""
    flags = Path("/proc/cpuinfo")
    known = set(flags.read_text(encoding="utf-8").split()) if flags.exists() else set()
    needed = {"SandyBridge": "avx", "Haswell": "avx2", "Zen": "avx2", "SkylakeX": "avx512vl"}
    return name not in needed or needed[name] in known
