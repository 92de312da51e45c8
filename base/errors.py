"""The errors a user can cause or must be told about."""


class InputError(ValueError):
    """Bad input, told in one line that names the key (or file) and the fix; the command line exits with 2."""


class ConvergenceError(RuntimeError):
    """A computation stopped short: says at which load, why and what to try. Accepted results are on disk
    already."""
