"""Load systems from a user's Python files, and access their fields by name."""

from ._field import Field as Field
from ._stated_system import stated_system as stated_system
from ._system_file import (
    classes_beside as classes_beside,
    split_name as split_name,
    system_class as system_class,
    system_source as system_source,
)
