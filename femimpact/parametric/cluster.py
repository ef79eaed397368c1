"""The workers of a cluster: the client of `distributed`, what its workers run, and whether that is the same code."""

from __future__ import annotations

import json
import os
import platform
import warnings
from collections.abc import Iterator, Mapping
from concurrent.futures import CancelledError, Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from femimpact import core
from femimpact.errors import Fault, InputError, InputWarning, kind_of, require
from femimpact.parametric.definition import ParameterStudy
from femimpact.parametric.evaluation import BlockValues, evaluated
from femimpact.parametric.identity import sources_key
from femimpact.regular_file import read_regular

__all__ = ["check_client", "check_workers", "cluster_executor", "connected", "evaluated_there"]

NEEDED = ("get_executor", "submit", "run", "nthreads")
"""Members of a client that are used."""

TIMEOUT = "10s"
"""For which a scheduler is waited for."""

SCHEDULER = "must be the address of a running scheduler, as tcp://host:8786, or its scheduler file"

MOST_BYTES = 10_000_000
"""Of a scheduler file."""


def check_client(client: object) -> None:
    """Refuse what is no client of a cluster."""
    fits = client is None or (not isinstance(client, type) and all(hasattr(client, name) for name in NEEDED))
    require(fits, "client", kind_of(client), "", "must be a distributed.Client")


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """A client of the scheduler at an address, or of the one that a scheduler file names.

    Raises
    ------
    InputError
        If there is none, or `distributed` is not installed.
    """
    try:
        from distributed import Client
    except ImportError:
        allowed = "needs the library distributed: pip install 'femimpact[cluster]'"
        raise InputError([Fault("scheduler", scheduler, "", allowed)]) from None
    address = _address_of(scheduler)
    make: Any = Client
    try:
        client = make(address, timeout=TIMEOUT)
    except (OSError, ValueError, TypeError) as error:
        words = " ".join(str(error).split()) or type(error).__name__
        raise InputError([Fault("scheduler", scheduler, "", f"{SCHEDULER}: {words}")]) from None
    with client:
        yield client


def _address_of(scheduler: str) -> str:
    """An address as it is, since it has a port; of a scheduler file the one that is written there."""
    if ":" in scheduler and not os.path.lexists(scheduler):
        return scheduler
    try:
        address = json.loads(read_regular(scheduler, MOST_BYTES))["address"]
    except OSError as error:
        words = f"no port, and as a file: {error.strerror}"
    except (ValueError, RecursionError):
        words = "the file is not JSON"
    except (KeyError, TypeError, IndexError):
        words = "the file has no address"
    else:
        if isinstance(address, str) and ":" in address:
            return address
        words = "the address in the file has no port"
    raise InputError([Fault("scheduler", scheduler, "", f"{SCHEDULER}: {words}")])


def worker_facts() -> dict[str, str]:
    """What decides the numbers of a worker: sources and versions, and its processor."""
    return {**_versions(), "processor": f"{core.build_info()['target']} {platform.machine()} {_model()}"}


def _versions() -> dict[str, str]:
    """Sources and versions of this process."""
    core_sources = str(core.build_info()["sources"])
    return {"sources": sources_key(), "core": core_sources, "numpy": np.__version__, "scipy": scipy.__version__}


def _model() -> str:
    """The name of the processor, where the system says it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")


def check_workers(client: Any) -> None:
    """Refuse workers of another version, and warn of processors of several kinds.

    Raises
    ------
    InputError
        If there is no worker, or one that has no femimpact, other sources or other versions of numpy and scipy.
    """
    try:
        found: dict[str, dict[str, str]] = client.run(worker_facts)
    except (ImportError, AttributeError) as error:
        allowed = f"must have workers with the same femimpact as this process: {error}"
        raise InputError([Fault("client", kind_of(client), "", allowed)]) from None
    require(bool(found), "client", "no worker", "", "must have one worker or more")
    for address, facts in found.items():
        _check_versions(f"worker {address}", facts, _versions(), "this process")
    processors = sorted({facts.get("processor", "unknown") for facts in found.values()})
    if len(processors) > 1:
        text = f"workers on several kinds of processors ({'; '.join(processors)}): the last bits may depend on which"
        warnings.warn(text, InputWarning, stacklevel=4)


def _check_versions(worker: str, facts: Mapping[str, str], expected: Mapping[str, str], whose: str) -> None:
    """Refuse a worker of another version."""
    for name, own in expected.items():
        # an earlier version may not tell all of it
        other = facts.get(name, "unknown")
        allowed = f"has {name} {other[:12]}, and {whose} {own[:12]}: install the same femimpact"
        require(other == own, worker, None, "", allowed)


@contextmanager
def cluster_executor(client: Any, study: ParameterStudy) -> Iterator[tuple[Executor, Any, int]]:
    """An executor on the workers, the study as `evaluated_there` takes it, and the number of threads of all workers.

    Raises
    ------
    InputError
        If a worker is refused, or the cluster drops the work.
    """
    check_workers(client)
    # a task, whose result is made anew where the worker that had it is lost
    there = client.submit(_received, study, _versions(), pure=False)
    try:
        with client.get_executor(pure=False, retries=3) as pool:
            yield pool, there, sum(client.nthreads().values())
    except CancelledError:
        allowed = (
            "has dropped the work: its scheduler must be running, and it and the workers must have every module "
            "that a function of your own uses"
        )
        raise InputError([Fault("client", kind_of(client), "", allowed)]) from None


def _received(study: ParameterStudy, versions: dict[str, str]) -> tuple[ParameterStudy, dict[str, str]]:
    """The study and the versions of the client's process, on a worker."""
    return study, versions


def evaluated_there(sent: tuple[ParameterStudy, dict[str, str]], cases: NDArray[np.int64]) -> BlockValues:
    """`evaluated` on a worker, which may have come after the others were checked.

    Raises
    ------
    InputError
        If the worker has another version than the process of the client.
    """
    study, versions = sent
    _check_versions(f"worker {platform.node()}", _versions(), versions, "the process with the client")
    return evaluated(study, cases)
