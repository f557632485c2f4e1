"""`python -m tests.api.many_viewers URL COUNT`: viewers of a preview, in a process of their own, as browsers are.

COUNT connections read as fast as they can, one more never reads. Prints `open` when each of COUNT has its first
picture; on a line of input the number of pictures that each has got, as JSON; at the end of input it ends.
"""

from __future__ import annotations

import asyncio
import json
import socket
import sys
from urllib.parse import urlsplit

PART = b"Content-Type: image/jpeg"


def connect(url: str, receive_buffer: int | None = None) -> socket.socket:
    """A connection that has asked for the preview."""
    parts = urlsplit(url)
    assert parts.hostname
    viewer = socket.socket()
    if receive_buffer is not None:
        viewer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    viewer.connect((parts.hostname, parts.port or 80))
    viewer.sendall(f"GET {parts.path}?{parts.query} HTTP/1.1\r\nHost: {parts.netloc}\r\n\r\n".encode())
    return viewer


async def view(url: str, counts: list[int], index: int) -> None:
    """Count the pictures that come."""
    viewer = connect(url)
    viewer.setblocking(False)
    loop, last = asyncio.get_running_loop(), b""
    while data := await loop.sock_recv(viewer, 1 << 16):
        counts[index] += (last + data).count(PART) - last.count(PART)
        last = data[-len(PART) :]


async def main(url: str, count: int) -> None:
    """Open all, and answer what is asked."""
    idle = connect(url, 4096)
    counts = [0] * count
    viewers = [asyncio.create_task(view(url, counts, index)) for index in range(count)]
    while not all(counts):
        await asyncio.sleep(0.05)
    print("open", flush=True)
    while await asyncio.to_thread(sys.stdin.readline):
        print(json.dumps(counts), flush=True)
    for viewer in viewers:
        viewer.cancel()
    idle.close()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2])))
