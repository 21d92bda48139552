"""Find impacts with flights of the model, where a motion hides them."""

from ._flown_impacts import located as located
