"""Checks of the installation: Python, packages, cores and memory, and the folders that are written to."""

from __future__ import annotations

import contextlib
import os
import platform
import shutil
import sys
import tempfile
from importlib import metadata
from pathlib import Path

import psutil
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from relit_camera.base.config.settings import RelitSettings
from relit_camera.doctor.report import Finding, ok, problem, warning

PACKAGE_NAME = "relit-camera"
EQUIVALENT_PACKAGES = {
    "onnxruntime": ("onnxruntime-gpu", "onnxruntime-directml", "onnxruntime-openvino"),
    "opencv-contrib-python-headless": ("opencv-contrib-python",),
}
"""Package → other packages that provide the same module."""
LOW_DISK_BYTES, MIN_DISK_BYTES = 1 << 30, 50 << 20
"""Free bytes below which there is a warning, or a problem: a subject has some 20 MB, the models 12 MB."""
MIN_CORES = 2


def check_python() -> Finding:
    """Check the version of Python."""
    found, needed = platform.python_version(), _needed_python()
    if needed.contains(found, prereleases=True):
        return ok("python", f"{found} at {sys.executable}")
    return problem("python", f"{found} at {sys.executable}, not {needed}", "install a newer Python")


def check_packages() -> Finding:
    """Check that every required package is installed, in an allowed version."""
    try:
        wanted = [Requirement(text) for text in metadata.requires(PACKAGE_NAME) or []]
    except metadata.PackageNotFoundError:
        return problem("packages", f"{PACKAGE_NAME} is not installed", "run: pip install -e . in its folder")
    needed = [
        requirement for requirement in wanted if not requirement.marker or requirement.marker.evaluate({"extra": ""})
    ]
    wrong = [text for text in map(_package_error, needed) if text]
    twice = next((names for names in map(_installed_names, EQUIVALENT_PACKAGES) if len(names) > 1), ())
    if not wrong and twice:
        # They install into one folder: the last one installed is used, so a GPU may stay unused without a message.
        seen = f"{' and '.join(twice)} are both installed and own the same folder"
        return warning("packages", seen, f"run: pip uninstall {' '.join(twice)}, then install the one that you want")
    if not wrong:
        versions = ", ".join(map(_name_and_version, ("onnxruntime", "numpy")))
        return ok("packages", f"{len(needed)} packages, {versions}{_missing_for_reports(wanted)}")
    return problem("packages", "; ".join(wrong), f"run: pip install --upgrade {PACKAGE_NAME}")


def check_cores(settings: RelitSettings) -> Finding:
    """Check that there are cores for the networks' threads beside the picture processing; reports memory too."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    memory = psutil.virtual_memory()
    threads = settings.inference.threads
    free = f"{memory.available >> 20} of {memory.total >> 20} MB memory free"
    seen = f"{cores} cores, {free}, inference.threads is {threads}"
    if cores < MIN_CORES:
        return warning("cores", seen, "give it two cores: with one the picture will not keep up with the camera")
    if threads > cores:
        return warning("cores", seen, f"set it to at most {cores}")
    return ok("cores", seen)


def check_folder(topic: str, folder: Path, cure: str) -> Finding:
    """Check that a folder, or the one in which it would be created, can be written to and has space."""
    place = next((path for path in (folder, *folder.parents) if path.exists()), folder)
    try:
        if not place.is_dir():
            return problem(topic, f"{place} is a file, not a folder", cure)
        with tempfile.TemporaryFile(dir=place):
            pass
        free = shutil.disk_usage(place).free
    except OSError as error:
        return problem(topic, f"{folder} cannot be written to: {error.strerror}", cure)
    seen = f"{folder}{'' if folder.exists() else ' (will be made)'}, {free >> 20} MB free"
    if free < MIN_DISK_BYTES:
        return problem(topic, seen, "free some space on the disk")
    if free < LOW_DISK_BYTES:
        return warning(topic, seen, "free some space on the disk")
    return ok(topic, seen)


def _needed_python() -> SpecifierSet:
    try:
        return SpecifierSet(metadata.metadata(PACKAGE_NAME)["Requires-Python"])
    except metadata.PackageNotFoundError:
        return SpecifierSet(">=3.11")


def _missing_for_reports(wanted: list[Requirement]) -> str:
    """What to install for HTML reports, after the rest of the finding; empty where nothing is missing."""
    extra = [each for each in wanted if each.marker and each.marker.evaluate({"extra": "evaluate"})]
    missing = [each.name for each in extra if not _installed_names(each.name)]
    if not missing:
        return ""
    return f"; HTML reports of `relit evaluate` need {' and '.join(missing)}: pip install '{PACKAGE_NAME}[evaluate]'"


def _package_error(requirement: Requirement) -> str:
    """What is wrong with a required package, or ""."""
    name, version = _installed(requirement.name)
    if version is None:
        return f"{requirement.name} is missing"
    return (
        ""
        if requirement.specifier.contains(version, prereleases=True)
        else f"{name} is {version}, not {requirement.specifier}"
    )


def _installed(name: str) -> tuple[str, str | None]:
    found = next(iter(_installed_names(name)), None)
    return (name, None) if found is None else (found, metadata.version(found))


def _installed_names(name: str) -> list[str]:
    """The installed ones of a package and its equivalents."""
    found = []
    for candidate in (name, *EQUIVALENT_PACKAGES.get(name, ())):
        with contextlib.suppress(metadata.PackageNotFoundError):
            metadata.version(candidate)
            found.append(candidate)
    return found


def _name_and_version(name: str) -> str:
    return " ".join(filter(None, _installed(name)))
