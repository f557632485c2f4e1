"""`python -m tests.vm.bare OUT.png`: from a bare Debian 12 to the picture in Chromium, by the README's commands, timed.

Needs root on Debian 12 and the network; half an hour under emulation, of which a real machine takes a tenth. The public
networks are fetched from their authors, or taken from `--models DIR`.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from tests.vm.machine import BOOT_WORDS, HERE, cache_folder, qemu_command

ROOT = HERE.parents[1]
LONGEST_S = 5400


def main() -> None:
    """Go the way, print how long each step took, keep the screenshot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="the screenshot, a PNG file")
    parser.add_argument("--models", type=Path, help="a folder of the public networks' files")
    parser.add_argument("--log", type=Path, default=Path("build/bare.txt"), help="what all steps printed")
    given = parser.parse_args()
    for script in ("build.sh", "bare.sh"):
        subprocess.run(["sh", HERE / script], check=True)
    with tempfile.TemporaryDirectory(prefix="relit-vm-") as folder:
        host = Path(folder, "host")
        shutil.copytree(HERE / "guest", host / "guest", ignore=shutil.ignore_patterns("__pycache__"))
        subprocess.run(["git", "clone", "--quiet", "--bare", ROOT, host / "checkout"], check=True)
        subprocess.run(["chown", "-R", "1000:1000", host / "checkout"], check=True)  # git reads only its owner's
        if given.models is not None:
            shutil.copytree(given.models, host / "models")
        cache = cache_folder()
        network = ["-netdev", "user,id=net", "-device", "virtio-net-pci,netdev=net"]
        boot = ["-append", f"{BOOT_WORDS} root=/dev/vda rw net.ifnames=0", "-serial", f"file:{folder}/console"]
        disks = [cache / "bare.img"]
        command = qemu_command(cache / "bare-vmlinuz", cache / "bare-initrd", disks, host, 4096)
        with suppress(subprocess.TimeoutExpired):
            subprocess.run([*command, *network, *boot], check=True, timeout=LONGEST_S)
        steps = host / "steps.tsv"
        if not steps.exists():
            sys.exit(
                f"the machine did nothing; its console:\n{Path(folder, 'console').read_text(errors='replace')[-3000:]}"
            )
        given.log.parent.mkdir(exist_ok=True)
        shutil.copyfile(host / "output.txt", given.log)
        rows = [line.split("\t") for line in steps.read_text().splitlines()]
        for seconds, status, title, _ in rows:
            print(f"{int(seconds):6d} s  {title}" + ("" if status == "0" else f"  FAILED ({status}), see {given.log}"))
        if (host / "call-page.png").exists():
            shutil.copyfile(host / "call-page.png", given.out)
        sys.exit(any(status != "0" for _, status, *_ in rows) or rows[-1][2] != "all")


if __name__ == "__main__":
    main()
