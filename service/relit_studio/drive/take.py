"""A take: one performance of one person in front of one camera, with its scene, landmarks and face visibility."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import Delaunay

from relit_camera.base.array_types import Float64Array, Indices
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.job import Scene, Shape
from relit_studio.cycles.person_objects import Figure
from relit_studio.drive.face_visibility import Surface, Visibility, visibility
from relit_studio.drive.performance import ActorState, Performance
from relit_studio.people.face.face_model import Part
from relit_studio.people.face.landmarks import landmarks
from relit_studio.people.face.mesh478_points import mesh_points
from relit_studio.people.person import Person
from relit_studio.people.props.held_objects import HeldObjects


@dataclass(frozen=True, eq=False)
class Take:
    """One performance of one person in front of one camera."""

    person: Person
    performance: Performance
    camera: Camera

    @cached_property
    def scene(self) -> Scene:
        """The scene for Cycles.

        Raises:
            StorageError: the cache cannot be written.
        """
        scene = self._figure.scene()
        if self._held is None:
            return scene
        return Scene((*scene.objects, *self._held.objects()), {**scene.materials, **self._held.materials()})

    def shape(self, time_s: float) -> Shape:
        """Geometry that changes with time."""
        actor = self.performance.state_at(time_s)
        shape = dict(self._figure.shape(actor.posture))
        if self._held and actor.gesture:
            motions = self._held.motions(actor.posture, actor.gesture)
            shape |= {f"{name}.matrix": motion for name, motion in motions.items()}
        # Applied after all other motion of an object.
        shift = np.eye(4)
        shift[:3, 3] = actor.shift_cm
        for each in self.scene.objects:
            shape[f"{each.name}.matrix"] = shift @ shape.get(f"{each.name}.matrix", np.eye(4))
        return shape

    def landmarks(self, actor: ActorState, scheme: str) -> Float64Array:
        """Points (count, 3) of a landmark scheme in room axes."""
        return np.asarray(landmarks(self.person, actor.posture)[scheme] + actor.shift_cm)

    def visibility(self, actor: ActorState, points: Float64Array) -> Visibility:
        """Visibility of the face, and of points (count, 3) on it."""
        vertices = self.person.vertices(actor.posture) + actor.shift_cm
        return visibility(self.camera, (vertices, self._face), self._occluders(actor), points)

    @cached_property
    def _figure(self) -> Figure:
        return Figure(self.person)

    @cached_property
    def _held(self) -> HeldObjects | None:
        return HeldObjects(self.person) if self.performance.handles else None

    @cached_property
    def _face(self) -> Indices:
        """Triangles of the face, inside the outline of its landmarks in the frontal view."""
        model = self.person.model
        oval = Delaunay(mesh_points(model).interpolate(model.vertices)[:, :2])
        triangles = model.triangles(Part.FACE)
        middles = model.vertices[triangles].mean(axis=1)
        return triangles[oval.find_simplex(middles[:, :2]) >= 0]

    def _occluders(self, actor: ActorState) -> list[Surface]:
        """Surfaces that may occlude the face."""
        if self._held is None or actor.gesture is None:
            return []
        motions = self._held.motions(actor.posture, actor.gesture)
        return [
            (solid.vertices @ motions[name][:3, :3].T + motions[name][:3, 3] + actor.shift_cm, solid.triangles)
            for name, solid in self._held.solids.items()
        ]
