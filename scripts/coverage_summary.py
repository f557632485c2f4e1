"""Print the share of lines that the last test run executed, a line for each top folder; fail below the floor.

Read from `.coverage`, as `make pytest` leaves it; the floor is `fail_under` of `[tool.coverage.report]`.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from pathlib import Path

from coverage import Coverage
from coverage.exceptions import CoverageException

SERVICE = Path(__file__).resolve().parents[1] / "service"


def main() -> int:
    """Print the table; 0 if the whole is at or above the floor, else 1."""
    coverage = Coverage()
    coverage.load()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder, "coverage.json")
        try:
            total = coverage.json_report(outfile=str(report))
        except CoverageException as error:
            print(f"coverage: {error}; run make pytest first", file=sys.stderr)
            return 1
        files = json.loads(report.read_text())["files"]
    lines, executed = Counter[str](), Counter[str]()
    for name, found in files.items():
        parts = Path(name).resolve().relative_to(SERVICE).parts
        folder_name = "/".join(parts[: min(2, len(parts) - 1)])
        lines[folder_name] += found["summary"]["num_statements"]
        executed[folder_name] += found["summary"]["covered_lines"]
    for name in sorted(lines):
        print(
            f"{name:28}{executed[name]:7d} of {lines[name]:6d} lines {100 * executed[name] / max(lines[name], 1):6.1f} %"
        )
    floor = float(coverage.get_option("report:fail_under") or 0)  # type: ignore[arg-type]
    print(f"{'all':28}{sum(executed.values()):7d} of {sum(lines.values()):6d} lines {total:6.1f} % (floor {floor:g} %)")
    return int(total < floor)


if __name__ == "__main__":
    sys.exit(main())
