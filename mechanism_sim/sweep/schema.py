"""Schema of sweep files: every key with its bounds and its default."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from mechanism_sim.scene.quantities import Angle, Part, Time

Count = Annotated[int, Field(strict=True, ge=1)]


class WindowsPart(Part):
    """What is cut from the signals of the sensors, for data sets."""

    sensors: Annotated[list[str], Field(min_length=1)] | None = None  #: all of the scene if not
    samples: Annotated[int, Field(strict=True, ge=2)] = 1024  #: of a window
    overlap: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.0  #: of a window with the next
    per_run: Count | None = None  #: of every sensor, exactly; as many as there are if not
    type: Literal['float32', 'float64'] = 'float32'  #: of the samples in the file


class DesignPart(Part):
    """Which values the factors of `vary` take."""

    kind: Literal['latin_hypercube', 'sobol', 'random', 'sobol_indices'] = 'latin_hypercube'
    samples: Annotated[int, Field(strict=True, ge=2, le=1_000_000)] = 100  #: machines
    seed: Annotated[int, Field(strict=True, ge=0)] = 1  #: another one, another draw


class SweepFile(Part):
    """A sweep: scenes to run, and for how long.

    Overrides are by dotted path, as on the command line; the path ``scene`` is the scene itself.
    """

    title: str = ''
    description: str = ''
    scene: str | None = None  #: of the package, or a path relative to the sweep file
    set: dict[str, Any] = Field({})  #: overrides of every run
    grid: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field({})  #: all combinations
    runs: list[dict[str, Any]] = Field([])  #: each one combined with the grid
    vary: dict[str, Any] = Field({})  #: a distribution by path, see `mechanism_sim.sweep.design`
    design: DesignPart = DesignPart()
    measures: dict[str, str] = Field({})  #: figures of every run, by the name of their column
    limits: dict[str, str | float] = Field({})  #: by measure; which share of runs exceeds it
    repeat: Count = 1  #: how often each of them is run
    nudge: Angle = 1e-6  #: by how much more the crank's start is turned at every repetition
    revolutions: Count | None = None
    duration: Annotated[Time, Field(gt=0.0)] | None = None
    skip: float | str = 0  #: revolutions, or a time, that no figure is made of
    bags: bool = False
    windows: WindowsPart | None = None
