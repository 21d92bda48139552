"""Run the blocks of a sweep, and store them."""

from ._checksums import checked as checked
from ._cluster import cluster as cluster
from ._identity import about_section as about_section, digest as digest
from ._run import (
    AbstractJob as AbstractJob,
    Arrays as Arrays,
    Progress as Progress,
    run_blocks as run_blocks,
)
from ._store import (
    Store as Store,
    StoredVariable as StoredVariable,
    StoreLayout as StoreLayout,
    SWEEP as SWEEP,
)
