"""One performance by one person before one camera: what is rendered of it, and what can be seen of the face."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import Delaunay

from relit_studio.camera import Camera
from relit_studio.cycles.figure import Figure
from relit_studio.cycles.job import Scene, Shape
from relit_studio.drive.performance import Moment, Performance
from relit_studio.drive.visibility import Surface, Visibility, visibility
from relit_studio.people.face_model import Part
from relit_studio.people.geometry import Floats, Indices
from relit_studio.people.landmarks import landmarks
from relit_studio.people.mesh478 import mesh_points
from relit_studio.people.person import Person
from relit_studio.props.held import Held


@dataclass(frozen=True, eq=False)
class Take:
    """A take."""

    person: Person
    performance: Performance
    camera: Camera

    @cached_property
    def scene(self) -> Scene:
        """Everything that Cycles is given.

        Raises:
            StorageError: the cache cannot be written.
        """
        scene = self._figure.scene()
        if self._held is None:
            return scene
        return Scene((*scene.objects, *self._held.objects()), {**scene.materials, **self._held.materials()})

    def shape(self, time_s: float) -> Shape:
        """What has moved at a time."""
        moment = self.performance.moment(time_s)
        shape = dict(self._figure.shape(moment.posture))
        if self._held and moment.gesture:
            motions = self._held.motions(moment.posture, moment.gesture)
            shape |= {f"{name}.matrix": motion for name, motion in motions.items()}
        # Over whatever else moves in an object: vertices, strands, or all of it.
        shift = np.eye(4)
        shift[:3, 3] = moment.shift_cm
        for each in self.scene.objects:
            shape[f"{each.name}.matrix"] = shift @ shape.get(f"{each.name}.matrix", np.eye(4))
        return shape

    def landmarks(self, moment: Moment, scheme: str) -> Floats:
        """Points (count, 3) of a landmark scheme in room axes."""
        return np.asarray(landmarks(self.person, moment.posture)[scheme] + moment.shift_cm)

    def visibility(self, moment: Moment, points: Floats) -> Visibility:
        """What can be seen of the face, and of points (count, 3) on it."""
        vertices = self.person.vertices(moment.posture) + moment.shift_cm
        return visibility(self.camera, (vertices, self._face), self._before(moment), points)

    @cached_property
    def _figure(self) -> Figure:
        return Figure(self.person)

    @cached_property
    def _held(self) -> Held | None:
        return Held(self.person) if self.performance.handles else None

    @cached_property
    def _face(self) -> Indices:
        """Triangles of the face: what its landmarks enclose, seen from the front."""
        model = self.person.model
        oval = Delaunay(mesh_points(model).of(model.vertices)[:, :2])
        triangles = model.triangles(Part.FACE)
        middles = model.vertices[triangles].mean(axis=1)
        return triangles[oval.find_simplex(middles[:, :2]) >= 0]

    def _before(self, moment: Moment) -> list[Surface]:
        """What may be before the face."""
        if self._held is None or moment.gesture is None:
            return []
        motions = self._held.motions(moment.posture, moment.gesture)
        return [
            (solid.vertices @ motions[name][:3, :3].T + motions[name][:3, 3] + moment.shift_cm, solid.triangles)
            for name, solid in self._held.solids.items()
        ]
