"""Where the runs of an evaluation are made: here, on a dask cluster, or on a ray cluster, all through joblib."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from scpf.models.errors import InputError, MissingError, UsageError

LOCAL: Final = ("loky", "multiprocessing", "threading")
BACKENDS: Final = (*LOCAL, "dask", "ray")
CONNECT_S: Final = 30


@contextmanager
def workers(backend: str, jobs: int, scheduler: str | None = None) -> Iterator[None]:
    """Let joblib's ``Parallel`` run on ``jobs`` workers (−1: all) of a backend.

    ``scheduler``: address of a dask scheduler or a ray head that runs already, whose workers are all used; without one
    a cluster of ``jobs`` workers is started on this machine, and ended. Raises MissingError where the backend is not
    installed, InputError where nobody answers at the address.
    """
    from joblib import parallel_config

    if backend not in BACKENDS:
        raise UsageError(f"no backend {backend!r}", f"backends: {', '.join(BACKENDS)}")
    if scheduler is not None and backend in LOCAL:
        raise UsageError(f"--scheduler is not for {backend}", "give --backend dask or --backend ray")
    if backend == "dask":
        with _dask(jobs, scheduler), parallel_config(backend="dask"):
            yield
    elif backend == "ray":
        with _ray(jobs, scheduler), parallel_config(backend="ray"):
            yield
    else:
        with parallel_config(backend=backend, n_jobs=jobs):
            yield


@contextmanager
def _dask(jobs: int, scheduler: str | None) -> Iterator[None]:
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise MissingError("dask is not installed", "pip install 'scpf[dask]'") from error
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=CONNECT_S)
        except (OSError, ValueError) as error:
            raise InputError(
                f"no dask scheduler at {scheduler} ({error})", "start one with `dask scheduler`"
            ) from error
        with client:
            yield
        return
    count = None if jobs < 0 else jobs
    with (
        LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster),
    ):
        yield


@contextmanager
def _ray(jobs: int, scheduler: str | None) -> Iterator[None]:
    try:
        import ray
        from ray.util.joblib import register_ray
    except ImportError as error:
        raise MissingError(
            "ray is not installed", "pip install ray, or give --backend loky or dask"
        ) from error
    if scheduler is None:
        ray.init(num_cpus=None if jobs < 0 else jobs, log_to_driver=False)
    else:
        try:
            ray.init(address=scheduler, log_to_driver=False)
        except (ConnectionError, ValueError) as error:
            raise InputError(
                f"no ray cluster at {scheduler} ({error})", "start one with `ray start --head`"
            ) from error
    try:
        register_ray()
        yield
    finally:
        ray.shutdown()
