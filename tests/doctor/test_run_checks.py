"""The doctor sees what is wrong with a machine, and says what to do."""

from __future__ import annotations

import json
import os
import platform
import shutil
import socket
import tempfile
from importlib import metadata
from pathlib import Path
from typing import NoReturn

import psutil
import pytest

from relit_camera.app.setup.needed_models import OF_TRACKER
from relit_camera.base.config.settings import RelitSettings, ServerSettings
from relit_camera.base.models.model_store import ModelState, ModelStore
from relit_camera.doctor import run_checks as examining
from relit_camera.doctor.installation import check_cores, check_folder, check_packages, check_python
from relit_camera.doctor.models_and_subject import check_models, check_provider
from relit_camera.doctor.report import Finding, Report, Severity, report_lines
from relit_camera.doctor.run_checks import run_checks
from relit_camera.doctor.running_processes import check_port
from tests.cli.relit_command import call
from tests.doctor.fake_host import FakeMachine, everybody_may, expect

TOPICS = [
    "python", "packages", "configuration", "cores", "data folder", "models folder", "models", "provider", "subject",
    "webcam", "kernel module", "after a restart", "virtual camera", "pipewire", "camera portal", "browsers",
    "call apps", "port", "running", "service",
]  # fmt: skip


# Models and provider.


def test_missing_models_are_a_problem_if_the_tracker_needs_them() -> None:
    finding = check_models(RelitSettings())
    expect(finding, Severity.PROBLEM, "tracker mesh lacks face_mesh", "missing", "relit models pull")
    recorded = RelitSettings(tracker={"name": "recorded:track.json"})
    expect(check_models(recorded), Severity.WARNING, "0 of", "missing")


def test_a_damaged_model_is_named(tmp_path: Path) -> None:
    registry = ModelStore()
    registry.folder.mkdir()
    (registry.folder / "selfie_square.onnx").write_bytes(b"half of it")
    finding = check_models(RelitSettings(tracker={"name": "recorded:t.json"}), registry)
    expect(finding, Severity.WARNING, "damaged: selfie_square")


def test_pulled_models_are_fine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ModelStore, "state", lambda self, name: ModelState.PULLED)
    expect(check_models(RelitSettings()), Severity.OK, "in ")


def test_what_the_package_index_has_is_fine(monkeypatch: pytest.MonkeyPatch) -> None:
    manifest = ModelStore().manifest
    indexed = [name for name, model in manifest.models.items() if model.packaged]
    monkeypatch.setattr(
        ModelStore, "state", lambda self, name: ModelState.PULLED if name in indexed else ModelState.MISSING
    )
    expect(check_models(RelitSettings()), Severity.OK, "4 of 9", "openseeface, face_embedding")
    openseeface = RelitSettings(tracker={"name": "openseeface"})
    expect(check_models(openseeface), Severity.PROBLEM, "tracker openseeface lacks openseeface", "relit models pull")


def test_every_needed_model_is_in_the_manifest() -> None:
    known = ModelStore().names()
    assert all(name in known for groups in OF_TRACKER.values() for group in groups for name in group)


def test_the_provider_is_proven_by_its_nodes() -> None:
    expect(check_provider(RelitSettings(inference={"provider": "cpu"})), Severity.OK, "cpu (", "asked for: cpu")


def test_a_provider_that_is_not_there_is_a_warning_and_strict_a_problem() -> None:
    for strict, state in ((False, Severity.WARNING), (True, Severity.PROBLEM)):
        settings = RelitSettings(inference={"provider": "openvino", "strict": strict})
        expect(check_provider(settings), state, "install a build of ONNX Runtime", "set the provider to cpu")


# The installation.


def test_python_and_packages_of_these_tests_are_right() -> None:
    expect(check_python(), Severity.OK)
    expect(check_packages(), Severity.OK, "onnxruntime", "numpy")


def test_a_missing_package_and_an_old_one_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        if name == "scipy":
            raise metadata.PackageNotFoundError(name)
        return "1.0" if name == "numpy" else real(name)

    real = metadata.version
    monkeypatch.setattr(metadata, "version", version)
    expect(check_packages(), Severity.PROBLEM, "scipy is missing", "numpy is 1.0, not >=2", "pip install")


def test_what_reports_need_beyond_the_camera_is_told_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        if name == "matplotlib":
            raise metadata.PackageNotFoundError(name)
        return real(name)

    assert "reports" not in check_packages().seen
    real = metadata.version
    monkeypatch.setattr(metadata, "version", version)
    expect(check_packages(), Severity.OK, "reports", "need matplotlib: pip install 'relit-camera[evaluate]'")


def test_a_gpu_build_takes_the_place_of_the_usual_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        if name == "onnxruntime":
            raise metadata.PackageNotFoundError(name)
        return "1.30.0" if name == "onnxruntime-gpu" else real(name)

    real = metadata.version
    monkeypatch.setattr(metadata, "version", version)
    expect(check_packages(), Severity.OK, "onnxruntime-gpu 1.30.0")


def test_two_packages_of_one_module_are_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    real = metadata.version
    monkeypatch.setattr(metadata, "version", lambda name: "1.30.0" if name == "onnxruntime-gpu" else real(name))
    finding = check_packages()
    expect(finding, Severity.WARNING, "onnxruntime and onnxruntime-gpu", "pip uninstall onnxruntime onnxruntime-gpu")


def test_an_old_python_is_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "python_version", lambda: "3.9.2")
    expect(check_python(), Severity.PROBLEM, "3.9.2", ">=3.11")


def test_more_threads_than_cores_are_a_warning() -> None:
    expect(
        check_cores(RelitSettings(inference={"threads": 64})), Severity.WARNING, "inference.threads is 64", "at most"
    )


def test_folders_that_are_not_there_yet_are_fine(tmp_path: Path) -> None:
    finding = check_folder("data folder", tmp_path / "a" / "b", "choose another")
    expect(finding, Severity.OK, "will be made", "MB free")
    assert not (tmp_path / "a").exists()
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_a_folders_place_is_a_problem(tmp_path: Path) -> None:
    (tmp_path / "data").touch()
    expect(
        check_folder("data folder", tmp_path / "data", "choose another"),
        Severity.PROBLEM,
        "is a file",
        "choose another",
    )


def test_a_folder_that_cannot_be_written_is_a_problem(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> NoReturn:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    finding = check_folder("data folder", tmp_path, "set storage.data_dir")
    expect(finding, Severity.PROBLEM, "Permission denied", "storage.data_dir")


@pytest.mark.parametrize(("free_mb", "state"), [(10, Severity.PROBLEM), (500, Severity.WARNING), (5000, Severity.OK)])
def test_little_space_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free_mb: int, state: Severity) -> None:
    usage = shutil.disk_usage(tmp_path)._replace(free=free_mb << 20)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage)
    expect(check_folder("data folder", tmp_path, "?"), state, f"{free_mb} MB free")


# The port and the configuration.


def test_a_port_in_use_is_a_problem_and_says_by_whom() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        expect(check_port(ServerSettings(port=port)), Severity.PROBLEM, str(port), f"(process {os.getpid()})", "--port")
    expect(check_port(ServerSettings(port=port)), Severity.OK, "free")
    expect(check_port(ServerSettings(port=0)), Severity.OK)


def test_a_running_camera_is_no_trouble(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(psutil.Process, "cmdline", lambda self: ["/venv/bin/python", "/venv/bin/relit", "run"])
    with socket.create_server(("127.0.0.1", 0)) as listener:
        settings = ServerSettings(port=listener.getsockname()[1])
        expect(check_port(settings), Severity.OK, "a Relit Camera is running there")


def test_a_faulty_configuration_does_not_hide_the_rest(tmp_path: Path, machine: FakeMachine) -> None:
    config = tmp_path / "mine.yaml"
    config.write_text("output:\n  width: 1281\n")
    report = run_checks(config, machine.host, everybody_may)
    findings = {finding.topic: finding for finding in report.findings}
    expect(findings["configuration"], Severity.PROBLEM, "mine.yaml line 2", "output.width", "1281")
    expect(findings["webcam"], Severity.OK)
    assert not report.healthy


# The report.


def test_everything_is_looked_at_and_nothing_is_written(tmp_path: Path, machine: FakeMachine) -> None:
    before = sorted(tmp_path.rglob("*"))
    report = run_checks(host=machine.host, access=everybody_may)
    assert [finding.topic for finding in report.findings] == TOPICS
    assert sorted(tmp_path.rglob("*")) == before
    wrong = [finding.topic for finding in report.findings if finding.state is Severity.PROBLEM]
    assert wrong == ["models"]


def test_the_table_has_a_line_a_topic_and_the_cure_below() -> None:
    findings = (
        Finding(topic="port", state=Severity.OK, seen="free"),
        Finding(topic="webcam", state=Severity.PROBLEM, seen="none", cure="plug one in"),
        Finding(topic="cores", state=Severity.WARNING, seen="1", cure="two"),
    )
    assert list(report_lines(Report(version="1.2", findings=findings))) == [
        "ok       port    free",
        "problem  webcam  none",
        "                 → plug one in",
        "warning  cores   1",
        "                 → two",
        "Relit Camera 1.2: 1 problem, 1 warning",
    ]
    assert list(report_lines(Report(version="1.2", findings=findings[:1])))[-1] == "Relit Camera 1.2: all is well"


def test_the_command_prints_text_or_json_and_exits_with_1_for_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = call("doctor")
    assert answer.code == 1  # no models are pulled
    assert "run: relit models pull" in answer.out
    assert answer.err == ""
    as_json = call("doctor", "--json")
    report = Report.model_validate(json.loads(as_json.out))
    assert [finding.topic for finding in report.findings] == TOPICS
    assert as_json.code == 1


def test_the_command_exits_with_0_where_there_is_no_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    report = Report(version="1", findings=(Finding(topic="cores", state=Severity.WARNING, seen="1", cure="2"),))
    monkeypatch.setattr(examining, "run_checks", lambda config, with_fix: report)
    assert call("doctor").code == 0
