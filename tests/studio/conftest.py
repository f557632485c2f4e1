from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_studio.mannequin.__main__ import main
from relit_studio.people.clothing.shirt import Shirt
from relit_studio.people.face.face_model import read_face_model
from relit_studio.people.face.identity import identity_weights
from relit_studio.people.hair.hair_strands import Hairs
from relit_studio.people.people_assets import PeopleAssets
from relit_studio.people.person import Person
from relit_studio.people.traits.named_people import NAMED_PEOPLE

NOTHING = np.zeros((0, 3))
NO_FACES = np.zeros((0, 3), np.intp)


@pytest.fixture(scope="session")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command's output, small: 96 x 96 pictures under 12 lights, three frames of the clip."""
    out = tmp_path_factory.mktemp("mannequin") / "new" / "folder"
    assert main(["--out", str(out), "--size", "96", "--lights", "12", "--frames", "3", "--quiet"]) == 0
    return out


@pytest.fixture(scope="session")
def person(shared: Path) -> Person:
    """Adam's face alone."""
    model = read_face_model(shared / "faces" / "ict_facekit_light.npz")
    traits = NAMED_PEOPLE["adam"]
    bare = Shirt(NOTHING, NO_FACES, NOTHING, NO_FACES, np.zeros(len(model.vertices), bool))
    people_assets = PeopleAssets(model, np.zeros((len(model.vertices), 2)), NOTHING, NO_FACES, Path())
    hair = Hairs(np.zeros((0, 2, 3)), np.zeros((0, 2)), np.zeros(0))
    return Person(traits, people_assets, model.neutral(identity_weights(model, traits)), hair, bare)
