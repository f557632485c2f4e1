"""Nothing that decoders say reaches the terminal, and the terminal comes back."""

from __future__ import annotations

import os
import sys

import pytest

from relit_camera.base.images.decoder_messages import suppress_decoder_messages


def test_both_streams_are_quiet_inside_and_back_outside(capfd: pytest.CaptureFixture[str]) -> None:
    with suppress_decoder_messages():
        os.write(2, b"libpng error\n")
        sys.stdout.write("Warning\n")
    os.write(2, b"after\n")
    sys.stdout.write("after\n")
    out, err = capfd.readouterr()
    assert (out, err) == ("after\n", "after\n")


def test_an_error_brings_them_back_too(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="damaged"), suppress_decoder_messages():
        raise ValueError("damaged")
    os.write(2, b"after\n")
    assert capfd.readouterr().err == "after\n"
