"""The event loop as code of this machine, made by LLVM from the traced attempt.

XLA compiles an attempt as hundreds of inner loops over a batch, with shared values in
memory in between. Here one loop holds one attempt for as many batch elements as a
vector has numbers, and elements that end are replaced inside of it. For runs that are
not traced; the program is the same, results differ by rounding.
"""

from ._attempts import (
    Attempts as Attempts,
    attempts_of as attempts_of,
    key_of as key_of,
    laid_out as laid_out,
    Layout as Layout,
    say_lacking as say_lacking,
)
from ._machine import user_cache as user_cache, vector_width as vector_width
from ._mapped import Mapped as Mapped
from ._writer import Lacking as Lacking
