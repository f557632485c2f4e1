"""The session factory: providers are proven, threads are ours, every failure is one line."""

from __future__ import annotations

import gc
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from relit_camera.base.errors import ConfigError, DeviceError, ModelError
from relit_camera.base.models import onnx_runtime, provider_names, session_with_fallback
from relit_camera.base.models.session_with_fallback import (
    SessionOptions,
    open_session,
    require_provider,
    session_report,
)


def graph_bytes(shape: list[int | str] | None = None, element: int = TensorProto.FLOAT, ir_version: int = 10) -> bytes:
    """A graph that computes `total = image @ weight + weight[0]` with a 3 x 3 weight of 0 … 8."""
    weight = np.arange(9).reshape(3, 3).astype(helper.tensor_dtype_to_np_dtype(element))
    nodes = [
        helper.make_node("MatMul", ["image", "weight"], ["product"]),
        helper.make_node("Add", ["product", "row"], ["total"]),
    ]
    image = helper.make_tensor_value_info("image", element, shape or [1, 3])
    total = helper.make_tensor_value_info("total", element, None)
    data = [numpy_helper.from_array(weight, "weight"), numpy_helper.from_array(weight[0], "row")]
    graph = helper.make_graph(nodes, "small", [image], [total], data)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=ir_version)
    return model.SerializeToString()


def test_runs_by_name_and_says_its_shapes() -> None:
    opened = open_session(graph_bytes(["batch", 3]), "small")
    assert opened.inputs == {"image": ((None, 3), np.dtype("float32"))}
    assert list(opened.outputs) == ["total"]
    result = opened.run({"image": np.array([[1, 0, 0], [0, 2, 0]], np.float32)})
    np.testing.assert_array_equal(result["total"], [[0, 2, 4], [6, 9, 12]])


@pytest.mark.parametrize(
    ("element", "dtype"),
    [(TensorProto.DOUBLE, "float64"), (TensorProto.FLOAT16, "float16"), (TensorProto.INT64, "int64")],
)
def test_dtypes_are_numpys(element: int, dtype: str) -> None:
    opened = open_session(graph_bytes(element=element), "small")
    assert opened.inputs["image"].dtype == np.dtype(dtype)
    assert opened.run({"image": np.ones((1, 3), dtype)})["total"].tolist() == [[9, 13, 17]]


def test_a_file_opens_as_its_bytes_do(tmp_path: Path) -> None:
    path = tmp_path / "small.onnx"
    path.write_bytes(graph_bytes())
    image = np.ones((1, 3), np.float32)
    from_path, from_bytes = open_session(path, "path"), open_session(graph_bytes(), "bytes")
    np.testing.assert_array_equal(from_path.run({"image": image})["total"], from_bytes.run({"image": image})["total"])


def test_cpu_is_proven_by_placement_and_a_timed_warm_up() -> None:
    report = open_session(graph_bytes(), "small", SessionOptions("cpu", threads=2, strict=True)).report
    assert (report.requested, report.provider, report.why, report.cure) == ("cpu", "cpu", "", "")
    assert list(report.placement) == ["cpu"]
    assert 1 <= report.placement["cpu"] <= 2  # ONNX Runtime may fuse the two nodes
    assert report.threads == 2
    assert report.warm_up_ms is not None
    assert 0 < report.warm_up_ms < 1000


def test_a_model_of_open_size_is_not_fed_blindly() -> None:
    assert open_session(graph_bytes(["batch", "size"]), "open").report.warm_up_ms is None


def test_the_threads_are_explicit_and_do_not_spin(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[onnxruntime.SessionOptions] = []
    real = onnxruntime.InferenceSession

    def remember(model: object, options: onnxruntime.SessionOptions, **rest: object) -> onnxruntime.InferenceSession:
        given.append(options)
        return real(model, options, **rest)

    monkeypatch.setattr(onnxruntime, "InferenceSession", remember)
    open_session(graph_bytes(), "small", SessionOptions(threads=2))
    (options,) = given
    assert (options.intra_op_num_threads, options.inter_op_num_threads) == (2, 1)
    for pool in ("intra", "inter"):
        assert options.get_session_config_entry(f"session.{pool}_op.allow_spinning") == "0"


def missing_provider() -> str:
    return "cuda" if "cuda" not in provider_names.available_providers() else "migraphx"


def test_a_provider_that_is_not_there_degrades_with_a_reason() -> None:
    wanted = missing_provider()
    opened = open_session(graph_bytes(), "small", SessionOptions(wanted))
    assert (opened.requested, opened.provider) == (wanted, "cpu")
    assert opened.why == f"{wanted}: the installed ONNX Runtime was built without it"
    assert "set the provider to cpu" in opened.report.cure
    assert opened.run({"image": np.ones((1, 3), np.float32)})["total"].tolist() == [[9, 13, 17]]


def test_strict_fails_where_others_degrade() -> None:
    with pytest.raises(DeviceError, match=r"model small cannot run on \w+: the installed") as caught:
        open_session(graph_bytes(), "small", SessionOptions(missing_provider(), strict=True))
    assert "set the provider to cpu" in caught.value.cure


def test_auto_takes_the_cpu_where_nothing_better_was_built_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: ["CPUExecutionProvider"])
    opened = open_session(graph_bytes(), "small")
    assert (opened.requested, opened.provider, opened.why) == ("auto", "cpu", "")


@dataclass
class Driver:
    """The driver of an accelerator. Once it was reset, no session runs there any more."""

    was_reset: bool = False


def pretend_cuda(monkeypatch: pytest.MonkeyPatch, placement: dict[str, int]) -> Driver:
    """An ONNX Runtime that was built with CUDA, accepts it, and places the nodes so; with its driver."""
    driver = Driver()
    available = ["CUDAExecutionProvider", "CPUExecutionProvider"]
    real = onnxruntime.InferenceSession

    def accept(model: object, options: object, providers: list[str], **rest: int) -> onnxruntime.InferenceSession:
        assert providers in (available, available[1:])
        runtime = real(model, options, providers=available[1:], **rest)
        run = runtime.run

        def run_if_possible(*arguments: object) -> object:
            if driver.was_reset and providers == available:
                raise RuntimeError("CUDA failure 719: unspecified launch failure")
            return run(*arguments)

        runtime.run = run_if_possible
        return runtime

    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: available)
    monkeypatch.setattr(onnxruntime, "InferenceSession", accept)
    monkeypatch.setattr(session_with_fallback, "node_placement", lambda _: placement)
    monkeypatch.setattr(provider_names, "preload", lambda _: "")
    return driver


@pytest.mark.parametrize(
    ("placement", "why"),
    [({"cpu": 2}, "cuda: no node was placed there"), ({"cuda": 2, "cpu": 5}, "cuda: only 2 of 7 nodes")],
)
def test_a_provider_that_takes_no_nodes_is_not_believed(
    monkeypatch: pytest.MonkeyPatch, placement: dict[str, int], why: str
) -> None:
    pretend_cuda(monkeypatch, placement)
    opened = open_session(graph_bytes(), "small")
    assert opened.provider == "cpu"
    assert opened.why.startswith(why)
    with pytest.raises(DeviceError, match="`relit doctor` says how to install it"):
        open_session(graph_bytes(), "small", SessionOptions(strict=True))


def test_a_provider_that_takes_most_nodes_is_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_cuda(monkeypatch, {"cuda": 6, "cpu": 1})
    opened = open_session(graph_bytes(), "small", SessionOptions(strict=True))
    assert (opened.requested, opened.provider, opened.why) == ("auto", "cuda", "")


def test_an_accelerator_that_fails_to_run_degrades(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_cuda(monkeypatch, {"cuda": 2})
    real = onnx_runtime.warm_up
    calls = []

    def fail_once(*arguments: object) -> float | None:
        calls.append(arguments)
        if len(calls) == 1:
            raise RuntimeError("[ONNXRuntimeError] : 1 : FAIL : CUDA out of memory\nsecond line")
        return real(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(session_with_fallback, "warm_up", fail_once)
    opened = open_session(graph_bytes(), "small")
    assert (opened.provider, opened.why) == ("cpu", "cuda: CUDA out of memory")


def test_an_accelerator_that_fails_on_the_way_is_left_for_the_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    driver = pretend_cuda(monkeypatch, {"cuda": 2})
    opened = open_session(graph_bytes(), "small", SessionOptions("cuda"))
    image = np.ones((1, 3), np.float32)
    assert opened.run({"image": image})["total"].tolist() == [[9, 13, 17]]
    with pytest.raises(ModelError, match="it takes image"):
        opened.run({"image": image[0]})
    assert opened.provider == "cuda"  # wrong feeds are not the accelerator's fault
    driver.was_reset = True
    assert opened.run({"image": image})["total"].tolist() == [[9, 13, 17]]
    assert opened.provider == "cpu"
    assert "719" in opened.why
    report = next(each for each in session_report() if each.name == "small")
    assert "restart the camera" in report.cure
    assert opened.run({"image": image})["total"].tolist() == [[9, 13, 17]]


def test_a_model_that_can_be_made_again_is_not_kept_for_the_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    driver = pretend_cuda(monkeypatch, {"cuda": 2})
    freed: list[str] = []

    class Model(bytes):
        def __del__(self) -> None:
            freed.append("freed")

    made = []

    def make() -> bytes:
        made.append("made")
        return Model(graph_bytes())

    opened = open_session(make, "small", SessionOptions("cuda"))
    gc.collect()
    assert (made, freed) == (["made"], ["freed"])
    driver.was_reset = True
    assert opened.run({"image": np.ones((1, 3), np.float32)})["total"].tolist() == [[9, 13, 17]]
    assert (opened.provider, made) == ("cpu", ["made", "made"])


def test_what_a_provider_needs_is_known_before_a_model_is_opened() -> None:
    require_provider(SessionOptions("auto", strict=True))
    require_provider(SessionOptions(missing_provider()))
    with pytest.raises(DeviceError, match=r"cannot run on \w+: the installed .* was built without it; `relit doctor`"):
        require_provider(SessionOptions(missing_provider(), strict=True))
    with pytest.raises(ConfigError, match="unknown provider 'magic'"):
        require_provider(SessionOptions("magic"))


def test_strict_does_not_go_on_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    driver = pretend_cuda(monkeypatch, {"cuda": 2})
    opened = open_session(graph_bytes(), "small", SessionOptions("cuda", strict=True))
    driver.was_reset = True
    with pytest.raises(ModelError, match="719"):
        opened.run({"image": np.ones((1, 3), np.float32)})
    assert opened.provider == "cuda"


def test_an_unknown_provider_is_a_setting_at_fault() -> None:
    with pytest.raises(ConfigError, match=r"unknown provider 'cudaa'; use auto, .*cuda"):
        open_session(graph_bytes(), "small", SessionOptions("cudaa"))


def test_no_thread_is_a_setting_at_fault() -> None:
    with pytest.raises(ConfigError, match="at least 1"):
        open_session(graph_bytes(), "small", SessionOptions(threads=0))


def damaged_models() -> dict[str, bytes]:
    whole = graph_bytes()
    unknown = onnx.load_from_string(whole)
    unknown.graph.node[0].op_type = "NoSuchOperator"
    return {
        "empty": b"",
        "truncated": whole[: len(whole) // 2],
        "garbage": b"\x89PNG not a model at all",
        "zeros": bytes(200),
        "unknown operator": unknown.SerializeToString(),
        "of the future": graph_bytes(ir_version=999),
    }


@pytest.mark.parametrize("fault", damaged_models())
@pytest.mark.parametrize("strict", [False, True])
def test_a_damaged_model_is_one_clear_line(
    tmp_path: Path, fault: str, strict: bool, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "damaged.onnx"
    path.write_bytes(damaged_models()[fault])
    with pytest.raises(ModelError) as caught:
        open_session(path, "small", SessionOptions(strict=strict))
    assert str(caught.value).startswith(f"model small ({path}) ")
    assert "pull it again" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_a_missing_file_and_a_folder(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="does not exist; check the path"):
        open_session(tmp_path / "none.onnx", "small")
    with pytest.raises(ModelError, match="model small"):
        open_session(tmp_path, "small")


@pytest.mark.parametrize(
    "feeds",
    [{}, {"image": np.ones((1, 4), np.float32)}, {"image": np.ones((1, 3))}, {"picture": np.ones((1, 3), np.float32)}],
)
def test_wrong_feeds_are_one_clear_line(feeds: dict[str, np.ndarray], capfd: pytest.CaptureFixture[str]) -> None:
    opened = open_session(graph_bytes(), "small")
    with pytest.raises(ModelError, match=r"^model small failed: .*; it takes image float32 \[1, 3\]$") as caught:
        opened.run(feeds)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_a_failure_inside_the_graph_is_not_printed_either(capfd: pytest.CaptureFixture[str]) -> None:
    opened = open_session(graph_bytes(["batch", "size"]), "open")
    with pytest.raises(ModelError, match=r"model open failed: .*it takes image float32 \[\?, \?\]$"):
        opened.run({"image": np.ones((1, 4), np.float32)})
    assert capfd.readouterr() == ("", "")


def test_the_report_knows_the_open_sessions_only() -> None:
    second, first = open_session(graph_bytes(), "report b"), open_session(graph_bytes(), "report a")
    mine = [report for report in session_report() if report.name.startswith("report ")]
    assert mine == [first.report, second.report]
    del second
    gc.collect()
    assert [report.name for report in session_report() if report.name.startswith("report ")] == ["report a"]


def test_a_real_model_opens_without_a_word(shared: Path, capfd: pytest.CaptureFixture[str]) -> None:
    opened = open_session(shared / "models" / "face_landmarks_478.onnx", "face_mesh", SessionOptions("cpu"))
    outputs = opened.run({"image": np.zeros((1, 256, 256, 3), np.float32)})
    assert outputs["landmarks"].shape == (1, 1, 1, 1434)
    assert opened.report.placement["cpu"] > 100
    assert capfd.readouterr() == ("", "")
