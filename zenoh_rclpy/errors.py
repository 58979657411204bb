"""Errors, under the names of rclpy where it has one."""


class MiddlewareError(RuntimeError):
    """The network, a name or a call is not as it should be; the text says what to do."""


class ExternalShutdownException(MiddlewareError):  # noqa: N818
    """A signal asked the process to end while it was spinning."""


class ROSInterruptException(MiddlewareError):  # noqa: N818
    """A thread that sleeps has nothing to wait for any more."""


class InvalidSettingError(MiddlewareError, ValueError):
    """An environment variable makes no sense."""


class InvalidArgumentsError(MiddlewareError, ValueError):
    """Arguments after ``--ros-args`` make no sense."""


class InvalidQosOverridesError(MiddlewareError, ValueError):
    """A quality of service given by parameters is none, or is refused."""


class ParameterException(MiddlewareError):  # noqa: N818
    """Something is wrong with a parameter."""


class ParameterNotDeclaredException(ParameterException, KeyError):  # noqa: N818
    """A parameter is used that its node has not declared."""

    def __str__(self) -> str:
        return str(self.args[0])


class ParameterAlreadyDeclaredException(ParameterException):
    """A parameter is declared twice."""


class ParameterUninitializedException(ParameterException):
    """A parameter is read that was declared with a type only, and was given no value."""


class ParameterImmutableException(ParameterException):
    """A parameter that is read-only is to be undeclared."""


class InvalidParameterException(ParameterException):
    """The name of a parameter is none."""


class InvalidParameterTypeException(ParameterException, ValueError):  # noqa: N818
    """The first value of a parameter is of another type than its default."""


class InvalidParameterValueException(ParameterException, ValueError):  # noqa: N818
    """The first value of a parameter is refused."""
