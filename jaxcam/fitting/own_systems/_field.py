"""Select a number of a system by its dotted name."""

import dataclasses
from typing import Any


@dataclasses.dataclass(frozen=True)
class Field:
    """Selects a number of a system or a model: `Field("spring.stiffness")`.

    Two fields of the same name are equal and have the same hash, so problems of the
    same rig share compiled programs; separate `lambda` functions would prevent this.
    """

    name: str
    """Dotted name of the field."""

    def __call__(self, owner: Any) -> Any:
        for part in self.name.split("."):
            inside = isinstance(owner, tuple | list)
            owner = owner[int(part)] if inside else getattr(owner, part)
        return owner
