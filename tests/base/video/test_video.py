import gc
import struct
import subprocess
import sys
import textwrap
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.errors import ImageError, StorageError, VideoError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_readers import VideoInfo, VideoReader, probe_video
from relit_camera.base.video.video_writer import VideoWriter, rational_rate

COLOURS = np.array(
    [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255], [0, 0, 0], [200, 30, 60], [90, 140, 200], [127, 127, 127]],
    np.uint8,
)


def patches(width: int = 256, height: int = 128) -> DisplayImage:
    """Flat patches of eight colours, 4 x 2."""
    return np.kron(COLOURS.reshape(2, 4, 3), np.ones((height // 2, width // 4, 1), np.uint8))


def patch_centres(image: DisplayImage) -> NDArray[np.int_]:
    height, width = image.shape[:2]
    return image[height // 4 :: height // 2, width // 8 :: width // 4].reshape(-1, 3).astype(int)


def write(path: Path, images: Sequence[DisplayImage], fps: float = 30.0, *, crf: int = 18) -> Path:
    height, width = images[0].shape[:2]
    with VideoWriter(path, (width, height), fps, crf=crf) as video:
        for image in images:
            video.write(image)
    return path


def noise(count: int, width: int = 64, height: int = 48) -> list[DisplayImage]:
    rng = np.random.default_rng(1)
    coarse = rng.integers(0, 256, (count, height // 8, width // 8, 3), dtype=np.uint8)
    return list(np.kron(coarse, np.ones((1, 8, 8, 1), np.uint8)))


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".mov"])
def test_what_is_written_is_read(tmp_path: Path, suffix: str) -> None:
    images = noise(20)
    path = write(tmp_path / f"clip{suffix}", images, fps=25)
    with VideoReader(path) as video:
        frames = list(video)
    assert video.info.fps == 25
    assert (video.info.width, video.info.height) == (64, 48)
    assert video.info.frames == 20
    assert video.info.duration_s == pytest.approx(0.8, abs=0.01)
    assert [frame.index for frame in frames] == list(range(20))
    assert [frame.time_s for frame in frames] == pytest.approx([i / 25 for i in range(20)], abs=1e-3)
    for frame, image in zip(frames, images, strict=True):
        assert np.abs(frame.image.astype(int) - image)[4::8, 4::8].mean() < 6  # the right picture, in the right order
    assert not frames[0].image.flags.writeable


def test_colours_survive_a_round_trip(tmp_path: Path) -> None:
    path = write(tmp_path / "clip.mp4", [patches()] * 3, crf=8)
    with VideoReader(path) as video:
        read = patch_centres(list(video)[1].image)
    assert np.abs(read - COLOURS).max() <= 2
    with VideoReader(path, accurate=False) as video:
        assert np.abs(patch_centres(list(video)[1].image) - COLOURS).max() <= 4


def test_the_file_is_bt709_and_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "clip.mp4", [patches()], crf=4)
    with av.open(str(path)) as container:
        picture = next(container.decode(video=0))
        context = container.streams.video[0].codec_context
        tags = (context.colorspace, context.color_primaries, context.color_trc, context.color_range)
        assert tags == (1, 1, 1, 1)
        planes = [
            np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)[:, : plane.width]
            for plane in picture.planes
        ]
    red, green, blue = (COLOURS / 255).T
    luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue  # ITU-R BT.709-6, item 3
    truth = [16 + 219 * luma, 128 + 224 * (blue - luma) / 1.8556, 128 + 224 * (red - luma) / 1.5748]
    for plane, values in zip(planes, truth, strict=True):
        height, width = plane.shape
        got = plane[height // 4 :: height // 2, width // 8 :: width // 4].ravel()
        assert got == pytest.approx(values, abs=1.5)


@pytest.mark.parametrize(("size", "matrix"), [((128, 64), 5), ((1280, 720), 1)])
def test_without_a_named_matrix_size_decides(tmp_path: Path, size: tuple[int, int], matrix: int) -> None:
    path = tmp_path / "clip.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"crf": "4"})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        rgb = av.VideoFrame.from_ndarray(patches(*size), format="rgb24")
        picture = rgb.reformat(format="yuv420p", dst_colorspace=matrix, dst_color_range=1)
        picture.colorspace = 2
        container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    with VideoReader(path) as video:
        assert np.abs(patch_centres(next(iter(video)).image) - COLOURS).max() <= 4


@pytest.mark.parametrize(("width", "height"), [(65, 48), (64, 47), (65, 47)])
def test_odd_sizes_gain_a_copy_of_the_last_column_or_row(tmp_path: Path, width: int, height: int) -> None:
    image = np.zeros((height, width, 3), np.uint8)
    image[:, -1] = 250
    path = write(tmp_path / "odd.mp4", [image] * 2, crf=4)
    with VideoReader(path) as video:
        frame = next(iter(video)).image
    assert frame.shape == (48, 66 if width % 2 else 64, 3)
    assert frame[10, -1].min() > 180
    assert frame[10, :40].max() < 30


@pytest.mark.parametrize(
    ("fps", "rate"),
    [
        (30, Fraction(30)),
        (29.97, Fraction(30000, 1001)),
        (30000 / 1001, Fraction(30000, 1001)),
        (23.976, Fraction(24000, 1001)),
        (59.94, Fraction(60000, 1001)),
        (12.5, Fraction(25, 2)),
        (24, Fraction(24)),
        (7.5, Fraction(15, 2)),
    ],
)
def test_frame_rates_are_kept_as_fractions(tmp_path: Path, fps: float, rate: Fraction) -> None:
    assert rational_rate(fps) == rate
    path = write(tmp_path / "clip.mp4", noise(12), fps=fps)
    with av.open(str(path)) as container:
        assert container.streams.video[0].average_rate == rate
    assert probe_video(path).fps == pytest.approx(float(rate))


def test_times_of_a_varying_rate_survive(tmp_path: Path) -> None:
    times = [0.0, 0.1, 0.12, 0.5, 0.55, 1.3]
    path = tmp_path / "clip.mp4"
    with VideoWriter(path, (64, 48), 30) as video:
        for image, time_s in zip(noise(6), times, strict=True):
            video.write(image, time_s)
    with VideoReader(path) as video:
        assert [frame.time_s for frame in video] == pytest.approx(times, abs=1e-3)


def test_times_that_do_not_grow_are_moved_apart(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    with VideoWriter(path, (64, 48), 30) as video:
        for image, time_s in zip(noise(3), [0.5, 0.5, 0.4], strict=True):
            video.write(image, time_s)
    with VideoReader(path) as video:
        times = [frame.time_s for frame in video]
    assert len(times) == 3
    assert times == sorted(set(times))


# 16.16 fixed point (a, b, c, d) of ISO/IEC 14496-12, and the turn that an upright reader has to make.
TURNS: dict[str, tuple[tuple[int, int, int, int], Callable[[DisplayImage], NDArray]]] = {
    "upright": ((1, 0, 0, 1), lambda image: image),
    "clockwise": ((0, 1, -1, 0), lambda image: cv2.rotate(image, cv2.ROTATE_90_CLOCKWISE)),
    "upside down": ((-1, 0, 0, -1), lambda image: cv2.rotate(image, cv2.ROTATE_180)),
    "counter-clockwise": ((0, -1, 1, 0), lambda image: cv2.rotate(image, cv2.ROTATE_90_COUNTERCLOCKWISE)),
    "mirrored": ((-1, 0, 0, 1), lambda image: cv2.flip(image, 1)),
}


@pytest.mark.parametrize("turn", TURNS)
def test_rotation_flag_is_applied(tmp_path: Path, turn: str) -> None:
    matrix, upright = TURNS[turn]
    image = np.kron(COLOURS[:4].reshape(2, 2, 3), np.ones((32, 64, 1), np.uint8))
    path = write(tmp_path / "clip.mp4", [image] * 2, crf=4)
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + 4 + 40  # version 0: the matrix is 40 bytes into the track header
    a, b, c, d = (value << 16 for value in matrix)
    data[at : at + 36] = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(data)
    with VideoReader(path) as video:
        frame = next(iter(video)).image
    expected = upright(image)
    assert frame.shape == expected.shape
    assert (video.info.width, video.info.height) == (expected.shape[1], expected.shape[0])
    assert np.abs(frame[16::32, 16::32].astype(int) - expected[16::32, 16::32]).max() < 12


def gif(path: Path, count: int = 4) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("gif", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "rgb8"
        for image in noise(count):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24").reformat(format="rgb8")))
        container.mux(stream.encode(None))
    return path


def test_gifs_are_videos(tmp_path: Path) -> None:
    with VideoReader(gif(tmp_path / "clip.gif")) as video:
        frames = list(video)
    assert len(frames) == 4
    assert frames[3].time_s == pytest.approx(0.3, abs=0.011)
    assert np.abs(frames[2].image[4::8, 4::8].astype(int) - noise(4)[2][4::8, 4::8]).max() < 90  # 256 colours


def test_a_reader_reads_once_and_holds_nothing(tmp_path: Path) -> None:
    path = write(tmp_path / "clip.mp4", noise(10))
    with VideoReader(path) as video:
        assert len(list(video)) == 10
        assert list(video) == []
    with VideoReader(path) as video:
        next(iter(video))
    path.unlink()


def pictures_alive() -> int:
    return sum(isinstance(thing, av.VideoFrame) for thing in gc.get_objects())


@pytest.mark.slow
def test_pictures_read_are_freed_at_once(tmp_path: Path) -> None:
    path = write(tmp_path / "clip.mp4", noise(30))
    gc.collect()
    gc.disable()
    try:
        others = pictures_alive()
        with VideoReader(path) as reader:
            held = [pictures_alive() - others for _ in reader]
    finally:
        gc.enable()
    assert max(held) < 15  # of 30: the decoder keeps a few


def test_a_colon_in_a_name_is_no_protocol(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write(Path("12:30.mp4"), noise(3))
    assert len(list(VideoReader(Path("12:30.mp4")))) == 3


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match=r"no video at .*nowhere\.mp4"):
        VideoReader(tmp_path / "nowhere.mp4")
    with pytest.raises(VideoError, match="no video"):
        probe_video(tmp_path)


@pytest.mark.parametrize(
    ("content", "message"), [(b"", "is empty"), (b"not a video at all\n" * 90, "cannot be read as a video")]
)
def test_what_is_no_video_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "clip.mp4"
    path.write_bytes(content)
    with pytest.raises(VideoError, match=message):
        VideoReader(path)


def test_a_picture_is_no_video(tmp_path: Path) -> None:
    path = tmp_path / "picture.png"
    path.write_bytes(cv2.imencode(".png", patches())[1].tobytes())
    with pytest.raises(VideoError, match="is a picture"):
        VideoReader(path)


def test_sound_alone_is_no_video(tmp_path: Path) -> None:
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        sound = av.AudioFrame.from_ndarray(np.zeros((2, 1024), np.float32), format="fltp", layout="stereo")
        sound.rate = 44100
        container.mux(stream.encode(sound))
        container.mux(stream.encode(None))
    with pytest.raises(VideoError, match="no moving picture"):
        VideoReader(path)


@pytest.mark.parametrize(("curve", "name"), [(16, "PQ"), (18, "HLG")])
def test_hdr_is_refused_with_a_cure(tmp_path: Path, curve: int, name: str) -> None:
    path = tmp_path / "hdr.mov"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p10le"
        stream.codec_context.color_trc = curve
        picture = av.VideoFrame.from_ndarray(noise(1)[0], format="rgb24").reformat(format="yuv420p10le")
        container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    with pytest.raises(VideoError, match=rf"HDR video \({name}\).*HDR video switched off"):
        VideoReader(path)


def test_an_absurd_size_is_refused(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match="20000x40"):
        VideoWriter(tmp_path / "clip.mp4", (20000, 40), 30)
    path = tmp_path / "wide.gif"
    data = bytearray(gif(path).read_bytes())
    data[6:10] = struct.pack("<HH", 9000, 40)
    path.write_bytes(data)
    with pytest.raises(VideoError, match="9000x40"):
        VideoReader(path)


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".gif", ".avi"])
@pytest.mark.parametrize("fraction", [0.5, 0.95])
def test_a_cut_off_file_is_refused_and_counted(tmp_path: Path, suffix: str, fraction: float) -> None:
    path = tmp_path / f"clip{suffix}"
    if suffix == ".gif":
        gif(path, 20)
    elif suffix == ".avi":
        with av.open(str(path), "w") as container:
            stream = container.add_stream("mjpeg", rate=30)
            stream.width, stream.height, stream.pix_fmt = 64, 48, "yuvj420p"
            for image in noise(20):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
    else:
        write(path, noise(20))
    whole = path.read_bytes()
    with VideoReader(path) as video:
        assert len(list(video)) == 20
    path.write_bytes(whole[: int(len(whole) * fraction)])
    with pytest.raises(VideoError, match=r"is cut off: \d+ (of \d+ )?frames can be read") as caught:
        VideoReader(path)
    counted = int(caught.value.what.split("cut off: ")[1].split()[0])
    assert 0 <= counted < 20


def test_a_cut_off_file_with_its_index_first_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    with av.open(str(path), "w", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=30, options={"crf": "4"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for image in noise(30):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode(None))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    with pytest.raises(VideoError, match=r"is cut off: (1\d|2\d|\d) of 30 frames"):
        VideoReader(path)


def test_damage_inside_is_told_after_the_good_frames(tmp_path: Path) -> None:
    path = write(tmp_path / "clip.mp4", noise(40), crf=4)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 4000] = bytes(4000)
    path.write_bytes(data)
    with VideoReader(path) as video, pytest.raises(VideoError, match=r"damaged: \d+ frames could be read, \d+ not"):
        list(video)
    with VideoReader(path) as video:
        assert len(list(zip(range(10), video, strict=False))) == 10


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"old")

    def fail_midway() -> None:
        with VideoWriter(path, (64, 48), 30) as video:
            video.write(noise(1)[0])
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        fail_midway()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_no_frames_no_file(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "clip.mp4", (64, 48), 30):
        pass
    assert list(tmp_path.iterdir()) == []


def test_pictures_of_another_size_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match="32x32"), VideoWriter(tmp_path / "clip.mp4", (64, 48), 30) as video:
        video.write(np.zeros((32, 32, 3), np.uint8))
    assert list(tmp_path.iterdir()) == []


def test_a_closed_writer_takes_no_more(tmp_path: Path) -> None:
    video = VideoWriter(tmp_path / "clip.mp4", (64, 48), 30)
    video.write(noise(1)[0])
    video.close()
    video.close()
    with pytest.raises(StorageError, match="closed"):
        video.write(noise(1)[0])


def test_unknown_suffixes_and_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match=r"name it with one of \.mkv, \.mov, \.mp4"):
        VideoWriter(tmp_path / "clip.foo", (64, 48), 30)
    with pytest.raises(StorageError, match="create the folder"):
        VideoWriter(tmp_path / "nowhere" / "clip.mp4", (64, 48), 30)


@pytest.mark.slow
@pytest.mark.parametrize("limit", [20_000, 200])
def test_a_full_disk_is_one_clear_error(tmp_path: Path, limit: int) -> None:
    # A limit on file size, in a process of its own, stands for a full disk: the same failing write.
    script = textwrap.dedent(f"""
        import resource, signal, sys
        import numpy as np
        from pathlib import Path
        from relit_camera.base.errors import StorageError
        from relit_camera.base.video.video_writer import VideoWriter
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
        rng = np.random.default_rng(0)
        try:
            with VideoWriter(Path(sys.argv[1]), (64, 48), 30) as video:
                for _ in range(60):
                    video.write(rng.integers(0, 256, (48, 64, 3), dtype=np.uint8))
        except StorageError as error:
            print(error)
    """)
    path = tmp_path / "clip.mp4"
    done = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, timeout=60)
    assert done.stdout.startswith(f"cannot write {path}: File too large")
    assert done.stdout.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


REAL_CLIPS = {
    "adam_talk.mp4": (320, 320, 24, 96),
    "asl_hungry.mkv": (640, 480, 30, 49),
    "asl_yes.mkv": (640, 480, 30, 65),
    "head-pose-face-detection-female.gif": (480, 270, 12.5, 23),
    "head-pose-face-detection-male.gif": (480, 270, 12.5, 62),
    "liveportrait_d0.mp4": (512, 512, 25, 78),
    "liveportrait_d19.mp4": (480, 480, 30, 250),
    "liveportrait_d9.mp4": (512, 480, 30, 587),
    "liveportrait_s18.mp4": (1280, 720, 30, 282),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", REAL_CLIPS)
def test_real_clips_are_read_whole(shared: Path, name: str) -> None:
    width, height, fps, count = REAL_CLIPS[name]
    path: Path = shared / "driving" / name
    previous = -1.0
    with VideoReader(path, accurate=False) as video:
        for number, frame in enumerate(video):
            assert frame.index == number
            assert frame.time_s > previous
            previous = frame.time_s
    info: VideoInfo = video.info
    assert (info.width, info.height, number + 1) == (width, height, count)
    assert info.fps == pytest.approx(fps)
    assert info.frames is not None
    assert abs(info.frames - count) <= 1
