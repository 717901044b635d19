"""Backends of the evaluation: the same numbers wherever they are made, and a remedy where one is missing."""

from __future__ import annotations

import sys

import pytest

from scpf.models.errors import InputError, MissingError, UsageError
from scpf.replay.cli import run
from scpf.replay.evaluation import evaluate
from scpf.replay.evaluation_backends import LOCAL
from scpf.replay.evaluation_plan import Plan

PLAN = Plan(("ekf", "pf"), ("S0",), (3.0,), runs=2, drives=2, frames=60)


@pytest.mark.parametrize("backend", LOCAL)
def test_local_backends_give_the_same_results(backend: str) -> None:
    assert evaluate(PLAN, jobs=2, backend=backend) == evaluate(PLAN)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_dask_cluster_gives_the_same_results() -> None:
    distributed = pytest.importorskip("distributed", reason="needs the extra dask")
    assert evaluate(PLAN, jobs=2, backend="dask") == evaluate(PLAN)
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        ran = client.run_on_scheduler(lambda dask_scheduler: dask_scheduler.transition_counter)
        assert evaluate(PLAN, backend="dask", scheduler=cluster.scheduler_address) == evaluate(PLAN)
        after = client.run_on_scheduler(lambda dask_scheduler: dask_scheduler.transition_counter)
    assert after > ran  # that cluster did the work, and is still there


def test_an_address_where_nobody_answers_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="needs the extra dask")
    monkeypatch.setattr("scpf.replay.evaluation_backends.CONNECT_S", 1)
    with pytest.raises(InputError, match=r"no dask scheduler at tcp://127.0.0.1:9"):
        evaluate(PLAN, backend="dask", scheduler="tcp://127.0.0.1:9")


@pytest.mark.parametrize(("backend", "package"), [("dask", "distributed"), ("ray", "ray")])
def test_a_backend_that_is_missing_says_how_to_install_it(
    backend: str, package: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingError, match="not installed") as caught:
        evaluate(PLAN, backend=backend)
    assert "pip install" in caught.value.hint
    tokens = ["evaluate", "--presets", "ekf", "--cases", "S0", "--runs", "1", "--frames", "60"]
    assert run([*tokens, "--backend", backend]) == 1
    assert "pip install" in capsys.readouterr().err


def test_a_scheduler_needs_a_backend_that_has_one() -> None:
    for wrong in ({"scheduler": "tcp://127.0.0.1:8786"}, {"backend": "slurm", "jobs": 2}):
        with pytest.raises(UsageError):
            evaluate(PLAN, **wrong)  # type: ignore[arg-type]
