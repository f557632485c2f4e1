"""How long a thread that could run has waited for a processor: what tells one that starves from one that hangs."""

from __future__ import annotations

from pathlib import Path


def run_delay_s(native_id: int) -> float:
    """Seconds for which this process's thread of that number has waited for a processor since it began.

    0 where the system does not tell (it is Linux that does), or where the thread has ended.
    """
    try:
        fields = Path(f"/proc/self/task/{native_id}/schedstat").read_bytes().split()
        return int(fields[1]) * 1e-9
    except (OSError, ValueError, IndexError):
        return 0.0
