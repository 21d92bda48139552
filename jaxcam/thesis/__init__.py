"""The printed numbers of the thesis, and the same numbers computed."""

from ._registry import (
    reproduce as reproduce,
    Target as Target,
    TARGETS as TARGETS,
)
from ._table_4_4 import table_4_4 as table_4_4
from ._table_5_2 import table_5_2 as table_5_2
from ._table_5_3 import table_5_3 as table_5_3
from ._table_6_1 import table_6_1 as table_6_1
from ._table_6_2 import table_6_2 as table_6_2
from ._table_6_3 import table_6_3 as table_6_3
from ._table_6_4 import table_6_4 as table_6_4
