"""Parts of a profile that the follower itself, or a cutter of its shape, takes away elsewhere.

The curvature shows where a profile folds back on itself (`profiles.find_flaws`). All that a fold,
a corner or a neighbouring lobe loses is seen only by sweeping the follower over the whole profile.
Where the point of contact is lost the follower comes lower than its law wants it.
"""

from __future__ import annotations

from dataclasses import dataclass

import scipy

from mechanism_sim.joints.cam.laws import spelled
from mechanism_sim.joints.cam.profiles import Cam, drawing_angles, extent, runs_of


@dataclass(frozen=True)
class CutAway:
    """Range of angles whose contact points are cut away by the follower at other angles.

    Parameters
    ----------
    start, end : [rad], to the step of the search
    worst : angle of the deepest cut [rad]
    depth : largest depth of the cut [m]
    reciprocating : True if the cam slides; angles are then displacements [m]
    """

    start: float
    end: float
    worst: float
    depth: float
    reciprocating: bool = False

    def __str__(self) -> str:
        ends = spelled(self.start, self.end, reciprocating=self.reciprocating)
        worst = spelled(self.worst, reciprocating=self.reciprocating)
        return (
            f'from {ends} the profile is cut away by the follower elsewhere, '
            f'by {1e3 * self.depth:.3g} mm at {worst}'
        )


def find_cut_away(cam: Cam) -> list[CutAway]:
    """Find the ranges in which the follower, swept over the profile, cuts its contacts away.

    A knife edge never does. What is less deep than a millionth of the base radius does not count.
    Points of the profile, and positions tried, are a 1440th of the turn or stroke apart.
    """
    x = drawing_angles(cam.law, extent(cam.law) / 1440)
    touch, roller = cam.at(x), getattr(cam.follower, 'roller', None)
    if roller is None:  # how far points of contact stand out beyond some position of the face
        height = (touch.normal * touch.profile).sum(axis=0)
        depth = (touch.profile.T @ touch.normal - height).max(axis=1)
    else:  # and come nearer than the roller's radius to one of its centres
        depth = roller - scipy.spatial.KDTree(touch.pitch.T).query(touch.profile.T)[0]
    runs = runs_of(x, depth, depth > 1e-6 * cam.base_radius)
    return [CutAway(*run, cam.law.reciprocating) for run in runs]
