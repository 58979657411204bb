"""Links that lean out of their plane: what a scene says of them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from mechanism_sim.scene.quantities import Inertia, Length, Part, si

_SHARE = Field(ge=0.0, lt=1.0)


class TiltPart(Part):
    """How a link leans out of its plane: by small rotations about its x and y axes."""

    stiffness: Annotated[float, si('N m/rad'), Field(ge=0.0, allow_inf_nan=False)]
    """Of what holds it in its plane, against rotation about either axis."""
    inertia: tuple[Inertia, Inertia] | None = None
    """Moments of inertia about the link's x and y axes through its centre of gravity."""
    thickness: Length | None = None
    """Instead of `inertia`: of a bar of square section along the link's x axis."""
    damping: Annotated[float, _SHARE] = 0.0
    """Ratio of critical damping of either rotation by itself, and of the motion along the axes."""
    axial_stiffness: Annotated[float, si('N/m'), Field(ge=0.0, allow_inf_nan=False)] = 0.0
    """Of what holds it along the axes, where a bearing of it has `clearance.axial`."""

    @model_validator(mode='after')
    def _weighed(self) -> TiltPart:
        if (self.inertia is None) == (self.thickness is None):
            raise ValueError(
                "needs either 'inertia', as [20 kg mm^2, 3000 kg mm^2], or 'thickness'"
            )
        return self
