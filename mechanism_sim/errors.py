"""What can go wrong, as users meet it: one sentence, and the exit code it deserves."""


class InputError(ValueError):
    """Something the user gave cannot be used; the command line ends with code 2."""


class RunError(RuntimeError):
    """A run failed although its input was good; the command line ends with code 1."""
