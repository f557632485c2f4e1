"""Print the share of lines that the last test run executed, a line for each folder of `service`, two levels deep.

Read from `.coverage`, as `make coverage` leaves it.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from pathlib import Path

from coverage import Coverage
from coverage.exceptions import NoDataError

SERVICE = Path(__file__).resolve().parents[1] / "service"


def main() -> int:
    """Print the table; 1 if there is no run to print."""
    coverage = Coverage()
    coverage.load()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder, "coverage.json")
        try:
            coverage.json_report(outfile=str(report))
        except NoDataError as error:
            print(f"coverage: {error}; run make coverage first", file=sys.stderr)
            return 1
        files = json.loads(report.read_text())["files"]
    statements, executed = Counter[str](), Counter[str]()
    for path, found in files.items():
        folders = Path(path).resolve().relative_to(SERVICE).parent.parts
        for name in ("/".join(folders[:2]), "all"):
            statements[name] += found["summary"]["num_statements"]
            executed[name] += found["summary"]["covered_lines"]
    for name in sorted(statements, key=lambda name: (name == "all", name)):
        share = 100 * executed[name] / max(statements[name], 1)
        print(f"{name:28}{executed[name]:7d} of {statements[name]:6d} lines {share:6.1f} %")
    return 0


if __name__ == "__main__":
    sys.exit(main())
