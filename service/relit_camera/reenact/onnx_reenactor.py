"""A reenactor of the user's own: a published network (FOMM, LivePortrait …) exported to ONNX (docs/reenactors.md).

It sees square crops of heads. A flow warps the relit picture at full resolution; a picture is laid over the still.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.face.crop import Crop
from relit_camera.face.follow import FaceMotion
from relit_camera.reenact.contract import Answer, Network, unmoved_grid
from relit_camera.reenact.cutout import Cutout
from relit_camera.reenact.first_order import held_at_border
from relit_camera.reenact.head_crop import DrivingHead, cut_square, head_crop
from relit_camera.reenact.placement import inverse_affine, moved_body, still_from_output, visible_box
from relit_camera.reenact.reenactor import Move, Moved, Stage
from relit_camera.reenact.transfer import body_motion
from relit_camera.reenact.warp import Box, FlowPatch, Warp
from relit_camera.space.colour import srgb_decode, uint8_from_linear
from relit_camera.space.images import Frame, LinearImage, Mask

FADE = 0.1
"""Share of the crop's side over which a picture gives way to the still round it."""


class OnnxReenactor:
    """See `Reenactor`. While the face is lost or out of reach, the picture eases to the unmoved still."""

    def __init__(self, stage: Stage, path: Path) -> None:
        """Load and check the network at `path`.

        Raises:
            ModelError: it is missing, damaged, or breaks the contract.
        """
        self._face, self._size = stage.face, stage.size
        self._network = Network(path, stage.options)
        self._crop = head_crop(stage.face.pose, stage.face.size)
        self._source = cut_square(stage.subject.neutral, self._crop, self._network.side)
        self._network.check_at_rest(self._source)
        self._driver = DrivingHead(self._network.side)
        self._person = Cutout(stage.subject)
        self._placed = still_from_output(stage.subject.size, stage.size)

    def follow(self, motion: FaceMotion, frame: Frame) -> Move:
        """See `Reenactor.follow`.

        Raises:
            ModelError: the network fails on this frame, or breaks the contract; so does the move.
        """
        placed = self._placed
        if self._person.whole:
            body = body_motion(self._face, motion)
            placed = moved_body(placed, body.pivot, body.shift, body.scale, self._face.size[1])
        box = visible_box(placed, self._face.size, self._size)
        self._driver.update(motion, frame)
        driving, initial = self._driver.driving, self._driver.initial
        seen = None if driving is None or initial is None or motion.presence == 0 else (driving, initial)
        # The flow is that of the still as it was captured, and known at once; a picture is made of the relit one.
        flow = self._network.answer(self._source, *seen).flow if seen and self._network.gives_flow else None
        patches = () if flow is None else (self._patch(flow, motion.presence),)
        positions = self._person.positions(Warp(placed, patches), box)

        def move(relit: LinearImage) -> Moved:
            picture, alpha = self._person.sampled(relit, positions)
            if seen and not self._network.gives_flow:
                source = cut_square(uint8_from_linear(relit), self._crop, self._network.side)
                answer = self._network.answer(source, *seen)
                assert answer.picture is not None
                affine = box_from_picture(self._crop, answer.picture.shape[:2], placed, box)
                _lay_over(picture, alpha, answer, motion.presence, affine)
            return Moved(picture, alpha, box[:2])

        return move

    def _patch(self, flow: NDArray[np.float32], share: float) -> FlowPatch:
        """A `share` of the network's flow, in still pixels."""
        # −1 and 1 are the middles of the outermost pixels of the crop.
        half = self._crop.width / 2 * (1 - 1 / self._network.side)
        displacement = (flow - unmoved_grid(*flow.shape[:2])) * np.float32(half * share)
        middle = np.array(self._crop.centre)
        patch = FlowPatch(displacement, np.concatenate([middle - half, middle + half]))
        return patch if self._person.whole else held_at_border(patch, self._face.size)


def box_from_picture(crop: Crop, shape: tuple[int, ...], placed: NDArray[np.float64], box: Box) -> NDArray[np.float64]:
    """The affine map (2, 3) from a picture of `crop` to the output pixels of `box`, for cv2: pixel centres at integers.

    Args:
        crop: in the still.
        shape: (rows, columns) of its picture.
        placed: output pixels → still pixels.
        box: left, top, right, bottom in output pixels.
    """
    box_from_still = inverse_affine(placed)
    box_from_still[:, 2] -= box[:2]
    still_from_picture = np.vstack([crop.picture_from_pixels(shape[1], shape[0]), [0, 0, 1]])
    affine = np.asarray(box_from_still @ still_from_picture, dtype=np.float64)
    affine[:, 2] += affine[:, :2] @ [0.5, 0.5] - 0.5
    return affine


def _lay_over(picture: LinearImage, alpha: Mask, answer: Answer, share: float, affine: NDArray[np.float64]) -> None:
    """Blend a `share` of the network's picture into the unmoved one, in place.

    Without an alpha of its own it is cut out by the still's.
    """
    assert answer.picture is not None
    size = (picture.shape[1], picture.shape[0])
    cover = _cover(answer.picture.shape[:2])
    own = cover if answer.alpha is None else answer.alpha
    colours = cv2.warpAffine(srgb_decode(answer.picture), affine, size, borderMode=cv2.BORDER_REPLICATE)
    masks = cv2.warpAffine(np.dstack([cover, own]), affine, size)
    cover, own = masks[..., 0] * np.float32(share), alpha if answer.alpha is None else masks[..., 1]
    picture += cover[..., None] * (colours * own[..., None] - picture)
    alpha += cover * (own - alpha)


def _cover(shape: tuple[int, ...]) -> Mask:
    """1 in the middle of (rows, columns), smoothly 0 at its edges."""
    edges = [np.clip((np.minimum(np.arange(n), np.arange(n)[::-1]) + 0.5) / (FADE * n), 0, 1) for n in shape]
    share = np.minimum.outer(*edges)
    return np.asarray(share * share * (3 - 2 * share), dtype=np.float32)
