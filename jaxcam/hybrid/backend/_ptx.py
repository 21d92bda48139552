"""Compile a module to PTX, the assembly language of NVIDIA GPUs."""

import functools
import re
from typing import Any

import llvmlite.binding as llvm
import llvmlite.ir as ir

from ._writer import INT32, INT64, Writer


_TRIPLE = "nvptx64-nvidia-cuda"
# prefix of the functions of the C library in libdevice, NVIDIA's library of
# mathematical functions
_PREFIX = "__nv_"
_DECLARED = re.compile(r'^declare double @"(\w+)"\(', re.MULTILINE)


def thread(writer: Writer) -> tuple[Any, Any]:
    """Return the index of a thread and the number of threads, as 64-bit integers."""
    b: Any = writer.builder

    def register(name: str):
        kind = ir.FunctionType(INT32, [])
        function = writer.declare(f"llvm.nvvm.read.ptx.sreg.{name}.x", kind)
        return b.zext(b.call(function, []), INT64)

    size = register("ntid")
    first = b.mul(register("ctaid"), size)
    return b.add(first, register("tid")), b.mul(size, register("nctaid"))


def needed(text: str) -> list[str]:
    """Return the functions of the C library that a module calls."""
    return _DECLARED.findall(text)


def ptx_of(text: str, architecture: str, libdevice: bytes | None = None) -> str:
    """Return the PTX code of a module of LLVM IR.

    **Arguments:** the module; the architecture of the GPU, such as `"sm_80"`; and the
    code of libdevice, without which the functions of the C library remain undefined.
    """
    machine = _target().create_target_machine(cpu=architecture, opt=3)
    for name in needed(text):
        text = re.sub(rf'@"{name}"\(', f'@"{_PREFIX}{name}"(', text)
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = _TRIPLE, str(machine.target_data)
    if libdevice is not None:
        _link(module, libdevice)
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_assembly(module)


@functools.cache
def _target() -> Any:
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    return llvm.Target.from_triple(_TRIPLE)


def _link(module, libdevice: bytes) -> None:
    library = llvm.parse_bitcode(libdevice)
    library.triple, library.data_layout = module.triple, module.data_layout
    names = {function.name for function in library.functions}
    module.link_in(library)
    for function in module.functions:
        if function.name in names and not function.is_declaration:
            function.linkage = "internal"
