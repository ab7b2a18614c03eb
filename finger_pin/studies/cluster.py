"""Tasks on a Dask cluster.

The workers need this package, of this very source. The process that asks records every run as it finishes; a worker
that dies loses the runs that it was doing, which Dask gives to others.
"""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from finger_pin.exceptions import FingerPinError, InputError
from finger_pin.studies.runs import Record, Stop, Task, execute

if TYPE_CHECKING:
    import distributed

_POLL = 0.05
_LOST = "the connection to the scheduler is lost"
_LOGGER = logging.getLogger("distributed.client")


class ClusterError(FingerPinError):
    """The cluster cannot go on; what it had finished is recorded."""


@dataclass(frozen=True)
class DaskCluster:
    """A Dask cluster.

    Attributes:
        address: Of its scheduler, such as ``tcp://10.0.0.5:8786``.
        timeout: How long to try to reach it, s.
    """

    address: str
    timeout: float = 10.0

    def start(self) -> DaskWorkers:
        """Return workers for the time of a ``with`` statement.

        Raises:
            InputError: If Dask is not installed, or the scheduler cannot be reached.
        """
        try:
            import distributed
        except ImportError:
            what = "needs Dask: python -m pip install distributed"
            raise InputError("scheduler", what, self.address) from None
        try:
            client = distributed.Client(self.address, timeout=self.timeout, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            what = f"cannot be reached: {str(error) or type(error).__name__}"
            raise InputError("scheduler", what, self.address) from None
        return DaskWorkers(client)


@dataclass(eq=False)
class DaskWorkers:
    """The workers of a cluster.

    Attributes:
        client: Connected to its scheduler.
    """

    client: distributed.Client
    _level: int = field(default=logging.NOTSET, init=False, repr=False)

    def __enter__(self) -> Self:
        """Return itself; an error says instead what the client logs about a lost scheduler."""
        self._level = _LOGGER.level
        _LOGGER.setLevel(logging.CRITICAL)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Disconnect; the cluster drops what it has not done."""
        self.client.close()
        _LOGGER.setLevel(self._level)

    def run(self, tasks: Sequence[Task], stop: Stop) -> Iterator[Record]:
        """Do tasks in any order and yield the record of each as soon as it is done; end early when told to stop.

        Raises:
            ClusterError: If the scheduler is lost, or the workers cannot do such tasks.
        """
        if not tasks:
            return
        import distributed

        # A name of its own for every attempt: what another study left on the cluster is not taken for a result.
        keys = [f"finger_pin-{task.key}-{uuid.uuid4().hex}" for task in tasks]
        futures = self.client.map(execute, tasks, key=keys, pure=False)
        asked = dict(zip(keys, tasks, strict=True))
        finished = distributed.as_completed(futures, loop=self.client.loop)
        del futures
        while not finished.is_empty() and not stop():
            if not finished.has_ready():
                if self.client.status not in ("running", "connecting"):
                    raise ClusterError(_LOST)
                time.sleep(_POLL)
                continue
            for future in finished.next_batch(block=False):
                if future.status in ("lost", "pending"):
                    # A worker died with the result on it, and another one does the run again.
                    finished.add(future)
                    continue
                yield _record(future, asked[str(future.key)])


def _record(future: Any, task: Task) -> Record:
    from distributed.scheduler import KilledWorker

    if future.status not in ("finished", "error"):
        raise ClusterError(f"{_LOST}: a run is {future.status}")
    try:
        record = future.result()
    except KilledWorker as error:
        return task.failed(f"the workers that ran it died: {error}")
    except (OSError, CancelledError) as error:
        raise ClusterError(f"{_LOST}: {error}") from error
    except Exception as error:
        raise ClusterError(f"the workers cannot run it: {type(error).__name__}: {error}") from error
    assert isinstance(record, Record)
    return record
