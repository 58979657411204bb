"""Schema of sweep files: every key with its bounds and its default."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from mechanism_sim.keys.quantities import Angle, Part, Time
from mechanism_sim.scene.schema import Scene

Count = Annotated[int, Field(strict=True, ge=1)]


class WindowsPart(Part):
    """Windows cut from the signals of the sensors, for data sets."""

    sensors: Annotated[list[str], Field(min_length=1)] | None = None
    """A list of names; all sensors of the scene if not given."""
    samples: Annotated[int, Field(strict=True, ge=2)] = 1024
    """Of a window."""
    overlap: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.0
    """Part of a window that the next one begins with."""
    per_run: Count | None = None
    """Windows of every sensor in every run, exactly; without it as many as there are."""
    type: Literal['float32', 'float64'] = 'float32'
    """Of the samples in the file."""

    @property
    def hop(self) -> int:
        """Samples from the start of a window to that of the next."""
        return max(1, round(self.samples * (1.0 - self.overlap)))

    def sensors_of(self, scene: Scene) -> tuple[str, ...]:
        """The sensors of a scene that windows are cut from."""
        return tuple(dict.fromkeys(self.sensors or scene.sensors))


class DesignPart(Part):
    """Values of the factors in `vary`."""

    kind: Literal['latin_hypercube', 'sobol', 'random', 'sobol_indices'] = 'latin_hypercube'
    """Sampling method."""
    samples: Annotated[int, Field(strict=True, ge=2, le=1_000_000)] = 100
    """Number of machines; for `sobol_indices` a power of 2, times the number of values + 2."""
    seed: Annotated[int, Field(strict=True, ge=0)] = 1
    """Seed of the random numbers."""

    other_words: ClassVar[Mapping[str, str]] = dict.fromkeys(('runs', 'n'), "'samples'")


class SweepFile(Part):
    """A sweep: scenes to run, and for how long.

    Overrides are by dotted path, as on the command line; the path ``scene`` is the scene itself.
    """

    title: str = ''
    """Title of the sweep."""
    description: str = ''
    """Description."""
    scene: str | None = None
    """Of the package, or a path relative to the sweep file; it may be swept like a value."""
    set: dict[str, Any] = Field({})
    """Overrides of every run, by dotted path."""
    grid: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field({})
    """Lists of values by dotted path: all combinations, the last path varies fastest."""
    runs: list[dict[str, Any]] = Field([])
    """A list of overrides for one run each; with a grid, each of them at every point of it."""
    vary: dict[str, Any] = Field({})
    """Distributions by dotted path, as `40 mm +- 0.1 mm`; of a point by components."""
    design: DesignPart = DesignPart()
    """Sampling of the distributions."""
    measures: dict[str, str] = Field({})
    """Measures of every run, by the name of their column."""
    limits: dict[str, str | float | list[str | float | None]] = Field({})
    """Limits by measure: the highest, `'> LOW'`, or `[LOW, HIGH]`; the share of runs beyond is
    computed."""
    repeat: Count = 1
    """Runs of each; a chaotic machine makes them independent, a periodic one does not."""
    nudge: Angle = 1e-6
    """Increment of the start angle of the crank from one repetition to the next."""
    revolutions: Count | None = None
    """Length of every run; this or `duration` is required."""
    duration: Annotated[Time, Field(gt=0.0)] | None = None
    """Length of every run, where a torque moves the crank."""
    skip: float | str = 0
    """Revolutions, or a time, that measures leave out."""
    bags: bool = False
    """Record every run: scene, laws, motion, impacts and changes of mode."""
    windows: WindowsPart | None = None
    """Cut windows from the signals of the sensors."""

    other_words: ClassVar[Mapping[str, str]] = {
        'seed': "'design.seed' of what is drawn at random, and of the noise of a sensor "
        'set: {sensors.NAME.noise.seed: 1}'
    }
