"""Functions that numba may compile, and that run without numba (extra `bench`) too."""

try:
    from numba.extending import register_jitable
except ModuleNotFoundError:  # the tests, which do not need it, are installed without it

    def register_jitable(function):
        return function


__all__ = ["register_jitable"]
