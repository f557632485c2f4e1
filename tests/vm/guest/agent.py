"""Runs in the test machine: does what the host asks over a serial port, until the host hangs up.

A line of JSON in, {"id", "command", "timeout"}: a shell command. Two lines out: {"id", "pid"} at once, and {"id",
"status", "output", "errors"} when it has ended. Commands run beside each other.
"""

import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress

TIMED_OUT = 124


def main(port):
    """Serve until the host hangs up."""
    lock = threading.Lock()
    descriptor = os.open(port, os.O_RDWR)  # it can be opened only once

    def reply(**values):
        text = json.dumps(values).encode() + b"\n"
        with lock:
            while text:
                text = text[os.write(descriptor, text) :]

    with os.fdopen(descriptor, "rb", buffering=0) as requests:
        for line in requests:
            threading.Thread(target=run, args=(json.loads(line), reply), daemon=True).start()


def run(request, reply):
    """Run one command and tell how it went."""
    process = subprocess.Popen(
        ["/bin/sh", "-c", request["command"]],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
    )
    reply(id=request["id"], pid=process.pid)
    try:
        output, errors = process.communicate(timeout=request["timeout"])
        status = process.returncode
    except subprocess.TimeoutExpired:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        output, errors = process.communicate()
        status = TIMED_OUT
    reply(id=request["id"], status=status, output=output, errors=errors)


if __name__ == "__main__":
    main(sys.argv[1])
