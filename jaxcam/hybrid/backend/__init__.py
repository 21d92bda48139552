"""Compile the event loop to machine code with LLVM, from one traced iteration.

XLA compiles an iteration as hundreds of inner loops over a batch and passes values
between them through memory. Here, a single loop contains one iteration for as many
batch elements as fit into a vector register, and replaces elements that end. This
backend is used for runs that are not traced. The traced iteration is the same as for
XLA; results differ only by rounding errors.
"""

from ._attempts import (
    Attempts as Attempts,
    attempts_of as attempts_of,
    key_of as key_of,
    say_lacking as say_lacking,
)
from ._choice import runs_by_llvm as runs_by_llvm
from ._cuda import cuda_attempts_of as cuda_attempts_of
from ._layout import laid_out as laid_out, Layout as Layout
from ._machine import user_cache as user_cache, vector_width as vector_width
from ._mapped import Mapped as Mapped
from ._rowwise import Rowwise as Rowwise
from ._writer import Lacking as Lacking
