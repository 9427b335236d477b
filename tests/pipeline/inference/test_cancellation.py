"""A network's run is ended from another thread, and can be asked again."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import onnx
import onnxruntime as ort
import pytest
from onnx import TensorProto, helper

from pipeline.inference.cancellation import Cancellation, Stopped, of_this_thread
from pipeline.inference.runtime import DetectorError, open_session, run_session
from tests.pipeline.vision.networks import IR_VERSION

WAIT_S = 180.0
ONE = np.ones(1, np.float32)


def counting(path: Path) -> ort.InferenceSession:
    """A network that counts up to its input, one step after the other."""
    value = helper.make_tensor_value_info
    one = helper.make_tensor("one", TensorProto.FLOAT, [1], [1.0])
    body = helper.make_graph(
        [helper.make_node("Add", ["sum", "one"], ["more"]), helper.make_node("Identity", ["go_on"], ["goes_on"])],
        "body",
        [value("i", TensorProto.INT64, []), value("go_on", TensorProto.BOOL, []), value("sum", TensorProto.FLOAT, [1])],
        [value("goes_on", TensorProto.BOOL, []), value("more", TensorProto.FLOAT, [1])],
        [one],
    )
    nodes = [
        helper.make_node("Cast", ["to"], ["times"], to=TensorProto.INT64),
        helper.make_node("Loop", ["times", "yes", "zero"], ["count"], body=body),
    ]
    graph = helper.make_graph(
        nodes,
        "counting",
        [value("to", TensorProto.FLOAT, [1])],
        [value("count", TensorProto.FLOAT, [1])],
        [
            helper.make_tensor("yes", TensorProto.BOOL, [], [True]),
            helper.make_tensor("zero", TensorProto.FLOAT, [1], [0.0]),
        ],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=IR_VERSION), path)
    return open_session(path.read_bytes(), path, 1)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> ort.InferenceSession:
    return counting(tmp_path_factory.mktemp("network") / "counting.onnx")


def test_a_run_is_ended_from_another_thread_and_the_next_one_answers(session: ort.InferenceSession) -> None:
    stop, ended = Cancellation(), []

    def run() -> None:
        try:
            with stop.here():
                run_session(session, 3e7 * ONE)
        except Stopped:
            ended.append("stopped")

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    while stop._under_way is None and thread.is_alive():
        pass  # as soon as it runs
    stop.set()
    thread.join(WAIT_S)
    assert ended == ["stopped"]
    assert run_session(session, 5 * ONE)[0] == 5


def test_what_is_to_end_already_does_not_begin(session: ort.InferenceSession) -> None:
    stop = Cancellation()
    stop.set()
    with stop.here(), pytest.raises(Stopped):
        run_session(session, ONE)
    assert run_session(session, ONE)[0] == 1, "outside of the block nobody stops it"


def test_a_network_that_fails_is_not_taken_for_one_that_was_stopped(session: ort.InferenceSession) -> None:
    with Cancellation().here(), pytest.raises(DetectorError):
        run_session(session, np.ones((2, 2), np.float32))


def test_blocks_within_each_other_and_other_threads_have_their_own() -> None:
    outer, inner, elsewhere = Cancellation(), Cancellation(), []
    with outer.here():
        with inner.here():
            assert of_this_thread() is inner
        assert of_this_thread() is outer
        thread = threading.Thread(target=lambda: elsewhere.append(of_this_thread()))
        thread.start()
        thread.join(WAIT_S)
    assert elsewhere[0] is not outer
    assert of_this_thread() is not outer
