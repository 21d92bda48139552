"""The printed numbers of the thesis, and the same numbers computed."""

from ._chapter_1 import figure_1_2 as figure_1_2, figure_1_3 as figure_1_3
from ._chapter_2 import (
    figure_2_3 as figure_2_3,
    figure_2_4 as figure_2_4,
    figure_2_7 as figure_2_7,
    figure_2_11 as figure_2_11,
    figure_2_13 as figure_2_13,
)
from ._chapter_3 import figure_3_8 as figure_3_8, figure_3_11 as figure_3_11
from ._chapter_4 import (
    figure_4_5 as figure_4_5,
    figure_4_13 as figure_4_13,
    figure_4_14 as figure_4_14,
    figure_4_15 as figure_4_15,
    figure_4_16 as figure_4_16,
)
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
