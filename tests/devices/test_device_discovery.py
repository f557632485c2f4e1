import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from relit_camera.base.errors import DeviceError
from relit_camera.cli.commands import devices as command
from relit_camera.devices.device_discovery import (
    DeviceFolders,
    VirtualCamera,
    Webcam,
    find_virtual_camera,
    find_webcam,
    list_virtual_cameras,
    list_webcams,
    negotiated_size,
)
from tests.devices.fake_devices import FakeTree

C920 = "usb-046d_HD_Pro_Webcam_C920_2B31-video-index0"


@pytest.fixture
def tree(tmp_path):
    tree = FakeTree(tmp_path)
    tree.add_webcam(0, "Integrated Camera: Integrated C", usb="3-1:1.0")
    tree.add_webcam(1, "Integrated Camera: Integrated C", usb="3-1:1.0", index=1)  # its metadata node
    tree.add_webcam(2, "HD Pro Webcam C920", by_id=C920)
    tree.add_loopback(9, "OBS Virtual Camera")
    tree.add_loopback(10, "Relit Camera")
    return tree


def test_each_webcam_is_listed_once_with_a_stable_id(tree):
    assert list_webcams(tree) == [
        Webcam(
            "usb-3-1:1.0-Integrated_Camera:_Integrated_C", "Integrated Camera: Integrated C", str(tree.dev / "video0")
        ),
        Webcam(C920, "HD Pro Webcam C920", str(tree.dev / "video2")),
    ]


def test_the_id_stays_when_the_node_changes(tree):
    before = find_webcam(C920, tree)
    tree.remove(2)
    tree.add_webcam(5, "HD Pro Webcam C920", usb="1-4:1.0", by_id=C920)
    after = find_webcam(C920, tree)
    assert after.id == before.id
    assert after.node == str(tree.dev / "video5")


def test_nodes_are_in_the_order_of_their_numbers(tmp_path):
    tree = FakeTree(tmp_path)
    for number in (10, 9, 2):
        tree.add_webcam(number, f"camera {number}", usb=f"1-{number}:1.0")
    assert [webcam.name for webcam in list_webcams(tree)] == ["camera 2", "camera 9", "camera 10"]


def test_virtual_cameras_say_whose_they_are(tree):
    tree.set_format(9, "YU12:1280x720@30\n")
    assert list_virtual_cameras(tree) == [
        VirtualCamera("OBS Virtual Camera", str(tree.dev / "video9"), False, (1280, 720)),
        VirtualCamera("Relit Camera", str(tree.dev / "video10"), True, None),
    ]


@pytest.mark.parametrize("text", ["webcam", "0", "{dev}/video0", "Integrated Camera: Integrated C"])
def test_a_webcam_is_found_by_any_of_its_names(tree, text):
    assert find_webcam(text.format(dev=tree.dev), tree).node == str(tree.dev / "video0")


def test_another_programs_virtual_camera_may_be_a_source(tree):
    assert find_webcam("OBS Virtual Camera", tree).node == str(tree.dev / "video9")


@pytest.mark.parametrize("text", ["Relit Camera", "{dev}/video10"])
def test_our_own_camera_is_never_a_source(tree, text):
    with pytest.raises(DeviceError, match="it would film itself"):
        find_webcam(text.format(dev=tree.dev), tree)


def test_our_own_camera_is_not_the_first_webcam(tmp_path):
    tree = FakeTree(tmp_path)
    tree.add_loopback(0, "Relit Camera")
    with pytest.raises(DeviceError, match="there is no webcam; plug one in"):
        find_webcam("webcam", tree)


def test_folders_that_vanish_while_they_are_read_hold_nothing(tree, monkeypatch):
    def gone(self, pattern):
        raise FileNotFoundError(self)

    monkeypatch.setattr(Path, "glob", gone)
    with pytest.raises(DeviceError, match="there is no webcam"):
        find_webcam("webcam", tree)


def test_an_unknown_webcam_lists_those_that_there_are(tree):
    with pytest.raises(DeviceError, match=rf"no webcam 'frontcam'; there are: .*{C920} \(HD Pro Webcam C920\)"):
        find_webcam("frontcam", tree)


def test_the_virtual_camera_is_found_by_its_label(tree):
    assert find_virtual_camera(tree).node == str(tree.dev / "video10")
    assert find_virtual_camera(tree, "OBS Virtual Camera").node == str(tree.dev / "video9")


def test_a_missing_virtual_camera_comes_with_its_command(tree, tmp_path):
    with pytest.raises(DeviceError, match=r"called 'Studio' .*run: sudo modprobe -r v4l2loopback &&") as caught:
        find_virtual_camera(tree, "Studio")
    assert caught.value.cure.endswith(
        'sudo modprobe v4l2loopback devices=1 video_nr=10 exclusive_caps=1 card_label="Studio"'
    )
    with pytest.raises(DeviceError, match=r"not loaded; run: sudo modprobe v4l2loopback .*; if it .* `relit doctor`"):
        find_virtual_camera(DeviceFolders(tmp_path / "none", tmp_path / "none"))


@pytest.mark.parametrize(
    ("text", "size"),
    [("YU12:640x480@30", (640, 480)), ("", None), ("YU12:640", None), ("NV12:1920x1080@59/2", (1920, 1080))],
)
def test_the_negotiated_size_is_read(tree, text, size):
    tree.set_format(10, text + "\n")
    assert negotiated_size("/dev/video10", tree) == size


def run(monkeypatch, tree, *arguments):
    monkeypatch.setattr(command, "list_webcams", lambda: list_webcams(tree))
    monkeypatch.setattr(command, "list_virtual_cameras", lambda label: list_virtual_cameras(tree, label))
    result = CliRunner().invoke(command.app, list(arguments))
    assert result.exit_code == 0
    return result.stdout


def test_the_command_lists_both_kinds(monkeypatch, tree):
    tree.set_format(10, "YU12:1280x720@30\n")
    text = run(monkeypatch, tree)
    assert C920 in text
    assert "OBS Virtual Camera (another program's, free)" in text
    assert "Relit Camera (ours, 1280x720, in use)" in text


def test_the_command_knows_a_renamed_camera_as_ours(monkeypatch, tree):
    monkeypatch.setenv("RELIT_OUTPUT__LABEL", "Studio")
    assert re.search('none of ours: run sudo modprobe .* card_label="Studio"', run(monkeypatch, tree))
    tree.add_loopback(11, "Studio")
    text = run(monkeypatch, tree)
    assert "Studio (ours, free)" in text
    assert "Relit Camera (another program's, free)" in text


def test_the_command_speaks_json(monkeypatch, tree):
    found = json.loads(run(monkeypatch, tree, "--json"))
    assert found["webcams"][1] == {"id": C920, "name": "HD Pro Webcam C920", "node": str(tree.dev / "video2")}
    assert found["virtual_cameras"][1]["ours"] is True


def test_the_command_is_content_with_no_devices(monkeypatch, tmp_path):
    nothing = DeviceFolders(tmp_path / "sys", tmp_path / "dev")
    assert "none of ours: run sudo modprobe v4l2loopback" in run(monkeypatch, nothing)
    assert json.loads(run(monkeypatch, nothing, "--json")) == {"webcams": [], "virtual_cameras": []}
