"""Exits with 0 if the camera in this container answers."""

import os
import sys
from urllib.request import urlopen

port = os.environ.get("RELIT_SERVER__PORT", "8470")
try:
    urlopen(f"http://127.0.0.1:{port}/healthz", timeout=3)
except OSError as error:
    sys.exit(f"no answer on port {port}: {error}")
