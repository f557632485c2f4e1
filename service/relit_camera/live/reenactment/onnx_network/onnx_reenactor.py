"""Reenactor `onnx:FILE`: the user's own network (FOMM, LivePortrait …), exported to ONNX (docs/reenactors.md).

It gets square crops of heads. A flow warps the relit picture at full resolution; a picture is laid over the source
image.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.errors import InputError
from relit_camera.base.images.affine import opencv_affine
from relit_camera.base.images.color import linear_from_uint8, srgb_decode, uint8_from_linear
from relit_camera.base.images.image_types import Box, Frame, LinearImage, Mask, RgbaImage
from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.face.landmarks.rotated_crop import Crop
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.reenactment.motion_transfer import split_body_motion
from relit_camera.live.reenactment.onnx_network.driving_head_crop import DrivingCrops, crop_square, head_crop
from relit_camera.live.reenactment.onnx_network.onnx_contract import NetworkOutput, ReenactorNetwork, identity_grid
from relit_camera.live.reenactment.reenactor import ReenactorContext, WarpedLayer, WarpTask
from relit_camera.live.reenactment.source_image import Cutout
from relit_camera.live.reenactment.warp import (
    FixedBorder,
    FlowPatch,
    Patch,
    Warp,
    inverse_affine,
    move_body,
    source_from_output,
    visible_box,
)
from relit_camera.live.render_quality import RenderQuality

EDGE_FADE = 0.1
"""Share of the crop's side over which a picture gives way to the source image round it."""


class OnnxReenactor:
    """See `Reenactor`. While the face is lost or out of reach, the picture eases to the unmoved source image."""

    def __init__(self, context: ReenactorContext) -> None:
        """Load and check the network whose file the context's argument names.

        Raises:
            InputError: no file is named.
            ModelError: it is missing, damaged, or breaks the contract.
        """
        if not context.argument:
            raise InputError("reenactor onnx needs a network", "name it 'onnx:FILE.onnx'")
        path = Path(context.argument).expanduser()
        self._face, self._size = context.face, context.size
        self._network = ReenactorNetwork(path, context.session)
        self._crop = head_crop(context.face.pose, context.face.size)
        self._source = crop_square(context.subject.neutral, self._crop, self._network.side)
        self._network.check_at_rest(self._source)
        self._driver = DrivingCrops(self._network.side)
        self._person = Cutout(context.subject)
        self._placed = source_from_output(context.subject.size, context.size)

    def plan_warp(self, motion: FaceMotion, frame: Frame, quality: RenderQuality) -> WarpTask:
        """See `Reenactor.plan_warp`.

        Raises:
            ModelError: the network fails on this frame, or breaks the contract; so does the task.
        """
        placed = self._placed
        if self._person.whole:
            body = split_body_motion(self._face, motion)
            placed = move_body(placed, body.pivot, body.shift, body.scale, self._face.size[1])
        box = visible_box(placed, self._face.size, self._size)
        self._driver.update(motion, frame)
        driving, initial = self._driver.driving, self._driver.initial
        seen = None if driving is None or initial is None or motion.presence == 0 else (driving, initial)
        # A flow is computed from the source image as it was captured, so at once; a picture from the relit one.
        flow = self._network.run(self._source, *seen).flow if seen and self._network.gives_flow else None
        patches = () if flow is None else self._patches(flow, motion.presence)
        grid = Warp(placed, patches).grid(box)

        def warp(relit: LinearImage) -> WarpedLayer:
            image = self._person.warped(self._person.image(relit), grid)
            if seen and not self._network.gives_flow:
                source = crop_square(display_from_linear(relit), self._crop, self._network.side)
                answer = self._network.run(source, *seen)
                assert answer.picture is not None
                affine = output_from_crop(self._crop, answer.picture.shape[:2], placed, box)
                _blend_prediction(image, answer, motion.presence, affine)
            return WarpedLayer(image, box[:2])

        return warp

    def _patches(self, flow: NDArray[np.float32], share: float) -> tuple[Patch, ...]:
        """A `share` of the network's flow, in source pixels."""
        # −1 and 1 are the middles of the outermost pixels of the crop.
        half = self._crop.width / 2 * (1 - 1 / self._network.side)
        displacement = (flow - identity_grid(*flow.shape[:2])) * np.float32(half * share)
        middle = np.array(self._crop.center)
        patch = FlowPatch(displacement, np.concatenate([middle - half, middle + half]))
        return (patch,) if self._person.whole else (patch, FixedBorder(self._face.size))


def output_from_crop(crop: Crop, shape: tuple[int, ...], placed: NDArray[np.float64], box: Box) -> NDArray[np.float64]:
    """The affine map (2, 3) from a picture of `crop` to the output pixels of `box`, for cv2: pixel centres at integers.

    Args:
        crop: in the source image.
        shape: (rows, columns) of its picture.
        placed: output pixels → source pixels.
        box: left, top, right, bottom in output pixels.
    """
    box_from_source = inverse_affine(placed)
    box_from_source[:, 2] -= box[:2]
    source_from_picture = np.vstack([crop.picture_from_pixels(shape[1], shape[0]), [0, 0, 1]])
    return opencv_affine(np.asarray(box_from_source @ source_from_picture, dtype=np.float64))


def _blend_prediction(image: RgbaImage, answer: NetworkOutput, share: float, affine: NDArray[np.float64]) -> None:
    """Blend a `share` of the network's picture into the unmoved one in linear light, in place.

    Without an alpha of its own it is cut out by the source image's.
    """
    assert answer.picture is not None
    size = (image.shape[1], image.shape[0])
    alpha = image[..., 3:] * np.float32(1 / 255)
    fade = _edge_fade_mask(answer.picture.shape[:2])
    masks = cv2.warpAffine(np.dstack([fade, fade if answer.alpha is None else answer.alpha]), affine, size)
    cover, own = masks[..., :1] * np.float32(share), alpha if answer.alpha is None else masks[..., 1:]
    colors = cv2.warpAffine(srgb_decode(answer.picture), affine, size, borderMode=cv2.BORDER_REPLICATE)
    below = linear_from_uint8(np.ascontiguousarray(image[..., :3])) * alpha
    light, mixed = below + cover * (colors * own - below), alpha + cover * (own - alpha)
    codes = uint8_from_linear(light / np.maximum(mixed, np.float32(1 / 255)))
    blended = np.dstack([codes, np.rint(mixed * 255).astype(np.uint8)])
    np.copyto(image, blended, where=cover > 0)


def _edge_fade_mask(shape: tuple[int, ...]) -> Mask:
    """1 in the middle of (rows, columns), smoothly 0 at its edges."""
    edges = [np.clip((np.minimum(np.arange(n), np.arange(n)[::-1]) + 0.5) / (EDGE_FADE * n), 0, 1) for n in shape]
    return smoothstep(np.minimum.outer(*edges)).astype(np.float32)
