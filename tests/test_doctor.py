"""The doctor sees what is wrong with a machine, and says what to do."""

from __future__ import annotations

import json
import os
import socket

import pytest

from relit_camera.config.settings import OutputSettings, RelitSettings, ServerSettings, SourceSettings
from relit_camera.doctor import examine as examining
from relit_camera.doctor import inference, installation
from relit_camera.doctor.cameras import check_virtual_camera, check_webcam
from relit_camera.doctor.examine import check_port, examine, table
from relit_camera.doctor.findings import Finding, Report, State
from relit_camera.doctor.inference import check_models, check_provider
from relit_camera.doctor.installation import check_cores, check_folder, check_packages, check_python
from relit_camera.models.registry import Registry
from tests.cli.relit_command import call
from tests.stream.fake_devices import FakeTree

TOPICS = [
    "python", "packages", "configuration", "cores", "data folder", "models folder", "models", "provider", "webcam",
    "virtual camera", "port",
]  # fmt: skip
C920 = "usb-046d_HD_Pro_Webcam_C920_2B31-video-index0"


@pytest.fixture
def tree(tmp_path):
    """A machine as it should be."""
    tree = FakeTree(tmp_path / "machine")
    tree.add_webcam(2, "HD Pro Webcam C920", by_id=C920)
    tree.add_loopback(10, "Relit Camera")
    set_exclusive_caps(tree, "Y,N,N,N,N,N,N,N")
    return tree


@pytest.fixture(autouse=True)
def own_folders(tmp_path, monkeypatch):
    monkeypatch.setenv("RELIT_STORAGE__DATA_DIR", str(tmp_path / "data"))
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "models"))
    monkeypatch.setenv("RELIT_SERVER__PORT", "0")
    monkeypatch.chdir(tmp_path)


def set_exclusive_caps(tree, text):
    folder = tree.sys / "module" / "v4l2loopback" / "parameters"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "exclusive_caps").write_text(text + "\n")


def nobody_may(path, mode):
    return False


def everybody_may(path, mode):
    return True


def expect(finding: Finding, state: State, *words: str):
    """Of that state; the words are in what was seen or its cure. What is not ok has a cure, what is ok has none."""
    assert finding.state is state, finding
    for word in words:
        assert word in f"{finding.seen} → {finding.cure}", finding
    assert bool(finding.cure) == (state is not State.OK), finding
    assert "\n" not in finding.seen + finding.cure


# The virtual camera.


def test_a_virtual_camera_as_it_should_be(tree):
    expect(check_virtual_camera(OutputSettings(), tree, everybody_may), State.OK, "Relit Camera", "video10")


def test_without_the_module_the_cure_loads_it(tmp_path):
    finding = check_virtual_camera(OutputSettings(), FakeTree(tmp_path / "bare"), everybody_may)
    expect(finding, State.PROBLEM, "not loaded", "sudo modprobe v4l2loopback", 'card_label="Relit Camera"')


def test_another_label_is_named(tree):
    finding = check_virtual_camera(OutputSettings(label="Studio"), tree, everybody_may)
    expect(finding, State.PROBLEM, "'Studio'", "there are 'Relit Camera'", 'card_label="Studio"')


def test_without_exclusive_caps_browsers_do_not_list_it(tree):
    set_exclusive_caps(tree, "N,N,N,N,N,N,N,N")
    finding = check_virtual_camera(OutputSettings(), tree, everybody_may)
    expect(finding, State.WARNING, "Chrome", "modprobe -r v4l2loopback", "exclusive_caps=1")


def test_exclusive_caps_count_for_each_device(tree):
    tree.add_loopback(9, "OBS Virtual Camera")
    set_exclusive_caps(tree, "Y,N,N,N,N,N,N,N")  # ours is the second now
    expect(check_virtual_camera(OutputSettings(), tree, everybody_may), State.WARNING, "exclusive_caps")
    set_exclusive_caps(tree, "N,Y,N,N,N,N,N,N")
    expect(check_virtual_camera(OutputSettings(), tree, everybody_may), State.OK)


def test_who_may_use_the_node_is_said(tree):
    expect(
        check_virtual_camera(OutputSettings(), tree, nobody_may), State.PROBLEM, "group", "usermod -aG", "log in again"
    )


def test_no_virtual_camera_is_needed_for_a_file(tmp_path):
    for sink in ("null", "out.mp4"):
        finding = check_virtual_camera(OutputSettings(sink=sink), FakeTree(tmp_path / sink), nobody_may)
        expect(finding, State.OK, "not needed", sink)


def test_a_node_given_as_sink_is_examined(tree):
    node = tree.add_loopback(11, "Spare", size=(1280, 720))
    set_exclusive_caps(tree, "Y,Y")
    finding = check_virtual_camera(OutputSettings(sink=node), tree, everybody_may)
    expect(finding, State.OK, "Spare", "video11", "in use at 1280x720")


def test_a_node_that_is_no_virtual_camera_is_a_problem_though_there_is_one(tree):
    node = str(tree.dev / "video97")
    finding = check_virtual_camera(OutputSettings(sink=node), tree, everybody_may)
    expect(finding, State.PROBLEM, "video97 is no virtual camera", "choose one of", "'Relit Camera'")
    bare = FakeTree(tree.dev.parent / "bare")
    finding = check_virtual_camera(OutputSettings(sink=str(bare.dev / "video97")), bare, everybody_may)
    expect(finding, State.PROBLEM, "modprobe")


# The webcam.


def test_a_webcam_is_named_with_its_node(tree):
    expect(check_webcam(SourceSettings(), tree, everybody_may), State.OK, "HD Pro Webcam C920", "video2")


def test_no_webcam_and_an_unknown_one_are_problems(tree, tmp_path):
    bare = FakeTree(tmp_path / "bare")
    expect(check_webcam(SourceSettings(), bare, everybody_may), State.PROBLEM, "no webcam", "--source FILE")
    expect(check_webcam(SourceSettings(source="usb-other"), tree, everybody_may), State.PROBLEM, "usb-other", C920)


def test_our_own_camera_is_no_webcam_whatever_it_is_called(tree):
    tree.add_loopback(12, "Studio")
    source = SourceSettings(source="Studio")
    expect(check_webcam(source, tree, everybody_may), State.OK, "video12")
    finding = check_webcam(source, tree, everybody_may, "Studio")
    expect(finding, State.PROBLEM, "film itself")


def test_who_may_read_the_webcam_is_said(tree):
    expect(check_webcam(SourceSettings(), tree, nobody_may), State.PROBLEM, "only be read by group", "usermod -aG")


def test_no_webcam_is_needed_for_a_file_or_the_pattern(tmp_path):
    clip = tmp_path / "clip.mp4"
    clip.touch()
    bare = FakeTree(tmp_path / "bare")
    for source in (str(clip), "pattern"):
        finding = check_webcam(SourceSettings(source=source), bare, nobody_may)
        expect(finding, State.OK, "not needed", source)


# Models and provider.


def test_missing_models_are_a_problem_if_the_tracker_needs_them():
    finding = check_models(RelitSettings())
    expect(finding, State.PROBLEM, "tracker mesh lacks face_mesh", "missing", "relit models pull")
    recorded = RelitSettings(tracker={"name": "recorded:track.json"})
    expect(check_models(recorded), State.WARNING, "0 of", "missing")


def test_a_damaged_model_is_named(tmp_path):
    registry = Registry()
    registry.folder.mkdir()
    (registry.folder / "selfie_square.onnx").write_bytes(b"half of it")
    finding = check_models(RelitSettings(tracker={"name": "recorded:t.json"}), registry)
    expect(finding, State.WARNING, "damaged: selfie_square")


def test_pulled_models_are_fine(monkeypatch):
    monkeypatch.setattr(Registry, "state", lambda self, name: inference.State.PULLED)
    expect(check_models(RelitSettings()), State.OK, "in ")


def test_every_needed_model_is_in_the_manifest():
    known = Registry().names()
    assert all(name in known for names in inference.NEEDED.values() for name in names)


def test_the_provider_is_proven_by_its_nodes():
    expect(check_provider(RelitSettings(inference={"provider": "cpu"})), State.OK, "cpu (", "asked for: cpu")


def test_a_provider_that_is_not_there_is_a_warning_and_strict_a_problem():
    for strict, state in ((False, State.WARNING), (True, State.PROBLEM)):
        settings = RelitSettings(inference={"provider": "openvino", "strict": strict})
        expect(check_provider(settings), state, "openvino", "set the provider to cpu")


# The installation.


def test_python_and_packages_of_these_tests_are_right():
    expect(check_python(), State.OK)
    expect(check_packages(), State.OK, "onnxruntime", "numpy")


def test_a_missing_package_and_an_old_one_are_named(monkeypatch):
    def version(name):
        if name == "scipy":
            raise installation.metadata.PackageNotFoundError(name)
        return "1.0" if name == "numpy" else real(name)

    real = installation.metadata.version
    monkeypatch.setattr(installation.metadata, "version", version)
    expect(check_packages(), State.PROBLEM, "scipy is missing", "numpy is 1.0, not >=2", "pip install")


def test_a_gpu_build_takes_the_place_of_the_usual_one(monkeypatch):
    def version(name):
        if name == "onnxruntime":
            raise installation.metadata.PackageNotFoundError(name)
        return "1.30.0" if name == "onnxruntime-gpu" else real(name)

    real = installation.metadata.version
    monkeypatch.setattr(installation.metadata, "version", version)
    expect(check_packages(), State.OK, "onnxruntime-gpu 1.30.0")


def test_two_packages_of_one_module_are_a_warning(monkeypatch):
    real = installation.metadata.version
    monkeypatch.setattr(
        installation.metadata, "version", lambda name: "1.30.0" if name == "onnxruntime-gpu" else real(name)
    )
    finding = check_packages()
    expect(finding, State.WARNING, "onnxruntime and onnxruntime-gpu", "pip uninstall onnxruntime onnxruntime-gpu")


def test_an_old_python_is_a_problem(monkeypatch):
    monkeypatch.setattr(installation.platform, "python_version", lambda: "3.9.2")
    expect(check_python(), State.PROBLEM, "3.9.2", ">=3.11")


def test_more_threads_than_cores_are_a_warning():
    expect(check_cores(RelitSettings(inference={"threads": 64})), State.WARNING, "inference.threads is 64", "at most")


def test_folders_that_are_not_there_yet_are_fine(tmp_path):
    finding = check_folder("data folder", tmp_path / "a" / "b", "choose another")
    expect(finding, State.OK, "will be made", "MB free")
    assert not (tmp_path / "a").exists()
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_a_folders_place_is_a_problem(tmp_path):
    (tmp_path / "data").touch()
    expect(
        check_folder("data folder", tmp_path / "data", "choose another"), State.PROBLEM, "is a file", "choose another"
    )


def test_a_folder_that_cannot_be_written_is_a_problem(tmp_path, monkeypatch):
    def refuse(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(installation.tempfile, "TemporaryFile", refuse)
    finding = check_folder("data folder", tmp_path, "set storage.data_dir")
    expect(finding, State.PROBLEM, "Permission denied", "storage.data_dir")


@pytest.mark.parametrize(("free_mb", "state"), [(10, State.PROBLEM), (500, State.WARNING), (5000, State.OK)])
def test_little_space_is_said(tmp_path, monkeypatch, free_mb, state):
    usage = installation.shutil.disk_usage(tmp_path)._replace(free=free_mb << 20)
    monkeypatch.setattr(installation.shutil, "disk_usage", lambda path: usage)
    expect(check_folder("data folder", tmp_path, "?"), state, f"{free_mb} MB free")


# The port and the configuration.


def test_a_port_in_use_is_a_problem_and_says_by_whom():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        expect(check_port(ServerSettings(port=port)), State.PROBLEM, str(port), f"(process {os.getpid()})", "--port")
    expect(check_port(ServerSettings(port=port)), State.OK, "free")
    expect(check_port(ServerSettings(port=0)), State.OK)


def test_a_running_camera_is_no_trouble(monkeypatch):
    monkeypatch.setattr(
        examining.psutil.Process, "cmdline", lambda self: ["/venv/bin/python", "/venv/bin/relit", "run"]
    )
    with socket.create_server(("127.0.0.1", 0)) as listener:
        settings = ServerSettings(port=listener.getsockname()[1])
        expect(check_port(settings), State.OK, "a Relit Camera is running there")


def test_a_faulty_configuration_does_not_hide_the_rest(tmp_path, tree):
    config = tmp_path / "mine.yaml"
    config.write_text("output:\n  width: 1281\n")
    report = examine(config, tree, everybody_may)
    findings = {finding.topic: finding for finding in report.findings}
    expect(findings["configuration"], State.PROBLEM, "mine.yaml line 2", "output.width", "1281")
    expect(findings["webcam"], State.OK)
    assert not report.healthy


# The report.


def test_everything_is_looked_at_and_nothing_is_written(tmp_path, tree, monkeypatch):
    before = sorted(tmp_path.rglob("*"))
    report = examine(tree=tree, access=everybody_may)
    assert [finding.topic for finding in report.findings] == TOPICS
    assert sorted(tmp_path.rglob("*")) == before
    wrong = [finding.topic for finding in report.findings if finding.state is State.PROBLEM]
    assert wrong == ["models"]


def test_the_table_has_a_line_a_topic_and_the_cure_below():
    findings = (
        Finding(topic="port", state=State.OK, seen="free"),
        Finding(topic="webcam", state=State.PROBLEM, seen="none", cure="plug one in"),
        Finding(topic="cores", state=State.WARNING, seen="1", cure="two"),
    )
    assert list(table(Report(version="1.2", findings=findings))) == [
        "ok       port    free",
        "problem  webcam  none",
        "                 → plug one in",
        "warning  cores   1",
        "                 → two",
        "Relit Camera 1.2: 1 problem, 1 warning",
    ]
    assert list(table(Report(version="1.2", findings=findings[:1])))[-1] == "Relit Camera 1.2: all is well"


def test_the_command_prints_text_or_json_and_exits_with_1_for_a_problem(monkeypatch):
    answer = call("doctor")
    assert answer.code == 1  # no models are pulled
    assert "run: relit models pull" in answer.out
    assert answer.err == ""
    as_json = call("doctor", "--json")
    report = Report.model_validate(json.loads(as_json.out))
    assert [finding.topic for finding in report.findings] == TOPICS
    assert as_json.code == 1


def test_the_command_exits_with_0_where_there_is_no_problem(monkeypatch):
    report = Report(version="1", findings=(Finding(topic="cores", state=State.WARNING, seen="1", cure="2"),))
    monkeypatch.setattr(examining, "examine", lambda config: report)
    assert call("doctor").code == 0
