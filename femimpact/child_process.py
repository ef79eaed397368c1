"""A child process whose output a thread reads: nothing of it is left when the block that uses it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, Any


@contextmanager
def child_process(
    command: Sequence[str],
    listen: Callable[[IO[bytes]], None],  # called in a thread with the standard output; returns where that ends
    **options: Any,  # of `subprocess.Popen`
) -> Iterator[subprocess.Popen[bytes]]:
    """Start a process; when the block ends, end it with all that it started, and wait for the thread.

    Its standard input is closed when this process ends, however that ends. A separate thread reads, for Windows can
    wait for no pipe with a time limit, and without a buffer: the lock of a buffer that a thread waits in stops Python
    where it ends meanwhile.

    Raises `OSError` if the process cannot be started.
    """
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True, **options
    )
    listener = threading.Thread(target=listen, args=(process.stdout,), daemon=True)
    listener.start()
    try:
        yield process
    finally:
        with suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()
        process.wait()
        # the pipe ends with the processes that write to it, and the thread with the pipe
        listener.join(10.0)
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()
