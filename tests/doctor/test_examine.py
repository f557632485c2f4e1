"""The doctor sees what is wrong with a machine, and says what to do."""

from __future__ import annotations

import json
import os
import socket

import pytest

from relit_camera.config.settings import RelitSettings, ServerSettings
from relit_camera.doctor import examine as examining
from relit_camera.doctor import inference, installation, running
from relit_camera.doctor.examine import examine
from relit_camera.doctor.findings import Finding, Report, State
from relit_camera.doctor.inference import check_models, check_provider
from relit_camera.doctor.installation import check_cores, check_folder, check_packages, check_python
from relit_camera.doctor.running import check_port
from relit_camera.doctor.text import table
from relit_camera.models.registry import Registry
from tests.cli.relit_command import call
from tests.doctor.fake_host import everybody_may, expect

TOPICS = [
    "python", "packages", "configuration", "cores", "data folder", "models folder", "models", "provider", "subject",
    "webcam", "kernel module", "after a restart", "virtual camera", "browsers", "port", "running", "service",
]  # fmt: skip


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
    monkeypatch.setattr(running.psutil.Process, "cmdline", lambda self: ["/venv/bin/python", "/venv/bin/relit", "run"])
    with socket.create_server(("127.0.0.1", 0)) as listener:
        settings = ServerSettings(port=listener.getsockname()[1])
        expect(check_port(settings), State.OK, "a Relit Camera is running there")


def test_a_faulty_configuration_does_not_hide_the_rest(tmp_path, machine):
    config = tmp_path / "mine.yaml"
    config.write_text("output:\n  width: 1281\n")
    report = examine(config, machine.host, everybody_may)
    findings = {finding.topic: finding for finding in report.findings}
    expect(findings["configuration"], State.PROBLEM, "mine.yaml line 2", "output.width", "1281")
    expect(findings["webcam"], State.OK)
    assert not report.healthy


# The report.


def test_everything_is_looked_at_and_nothing_is_written(tmp_path, machine):
    before = sorted(tmp_path.rglob("*"))
    report = examine(host=machine.host, access=everybody_may)
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
    monkeypatch.setattr(examining, "examine", lambda config, with_fix: report)
    assert call("doctor").code == 0
