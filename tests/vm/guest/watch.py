"""Reads pictures with OpenCV until OUT.stop appears: watch.py NODE OUT [COUNT].

Writes OUT.jsonl, a line a picture with the number that the test pattern carries (null if it is not the pattern), and
OUT.png, the last picture. Prints the format. A read that gives nothing is tried again; with COUNT it ends after so many
pictures, and with 1 at the first read that gives none.
"""

import json
import sys
import time
from pathlib import Path

import cv2
from pattern_number import read_number  # type: ignore[import-not-found]  # beside this file

node, out, count = sys.argv[1], sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else 0
capture = cv2.VideoCapture(int(node.removeprefix("/dev/video")), cv2.CAP_V4L2)
if not capture.isOpened():
    sys.exit(f"OpenCV cannot open {node}")
print(int(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little").decode(errors="replace"), flush=True)
image, seen = None, 0
with Path(f"{out}.jsonl").open("w") as rows:
    while not Path(f"{out}.stop").exists() and not (count and seen == count):
        done, read = capture.read()
        if done:
            image, seen = read, seen + 1
            row = {"at": time.monotonic(), "number": read_number(image), "size": [image.shape[1], image.shape[0]]}
            print(json.dumps(row), file=rows, flush=True)
        elif count:
            sys.exit(f"{node} gave {seen} pictures and then none")
if image is not None:
    cv2.imwrite(f"{out}.png", image)
