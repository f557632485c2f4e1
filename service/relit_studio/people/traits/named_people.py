"""Named people, and finding people by name or number."""

from __future__ import annotations

from relit_camera.base.errors import NotFoundError
from relit_studio.people.traits.person_traits import BrowTraits, RestingExpression, Traits
from relit_studio.people.traits.random_traits import random_traits

NAMED_PEOPLE = {
    person.name: person
    for person in (
        Traits("adam", 855, skin=(0.58, 0.36, 0.27), melanin=0.72, redness=0.4, iris=(0.13, 0.24, 0.33)),
        Traits(
            "bea", 14, skin=(0.50, 0.30, 0.205), shaved=False, hair="long", melanin=0.82, redness=0.25,
            iris=(0.14, 0.065, 0.025), resting=RestingExpression(-0.25), lips=(1.0, 0.72, 0.75),
            brows=BrowTraits(420, 0.7, 0.9, 1.2, 0.25), lashes=1.35, relief=0.6, flush=0.35, shirt=(0.30, 0.05, 0.06),
        ),
        Traits(
            "cem", 866, skin=(0.135, 0.066, 0.040), contrast=0.85, shaved=False, hair="buzz", melanin=0.95, redness=0.1,
            iris=(0.045, 0.02, 0.01), resting=RestingExpression(-0.15), lips=(1.15, 0.85, 0.85),
            brows=BrowTraits(560, 0.6, 1.1, 1.35, 0.45), shirt=(0.28, 0.27, 0.24),
        ),
    )
}  # fmt: skip
"""Traits by name."""


def find_traits(name: str) -> Traits:
    """Traits of a named person, or of the random person of a number.

    Raises:
        NotFoundError: the name is neither.
    """
    if name in NAMED_PEOPLE:
        return NAMED_PEOPLE[name]
    if name.isdecimal():
        return random_traits(int(name))
    raise NotFoundError(f"no person '{name}'", f"use {', '.join(NAMED_PEOPLE)}, or a number for a random person")
