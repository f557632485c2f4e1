"""`relit devices`: the webcams and virtual cameras of this machine."""

from __future__ import annotations

import dataclasses
import json
from typing import Annotated

import typer

from relit_camera.devices.device_discovery import (
    VirtualCamera,
    Webcam,
    list_virtual_cameras,
    list_webcams,
    modprobe_command,
)

app = typer.Typer()


@app.command()
def devices(
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """List the webcams that --source takes, and the virtual cameras."""
    from relit_camera.cli.arguments import load_command_settings

    label = load_command_settings(context).output.label
    webcams, virtual = list_webcams(), list_virtual_cameras(label=label)
    if as_json:
        found = {
            "webcams": [dataclasses.asdict(webcam) for webcam in webcams],
            "virtual_cameras": [dataclasses.asdict(camera) for camera in virtual],
        }
        typer.echo(json.dumps(found, indent=2))
    else:
        typer.echo(
            "\n".join(["Webcams", *_webcam_lines(webcams), "", "Virtual cameras", *_virtual_lines(virtual, label)])
        )


def _webcam_lines(webcams: list[Webcam]) -> list[str]:
    if not webcams:
        return ["  none: plug one in, or use --source FILE or --source pattern"]
    width = max(len(webcam.id) for webcam in webcams)
    return [f"  {webcam.id:<{width}}  {webcam.node}  {webcam.name}" for webcam in webcams]


def _virtual_lines(cameras: list[VirtualCamera], label: str) -> list[str]:
    lines = []
    for camera in cameras:
        owner = "ours" if camera.ours else "another program's"
        use = f"{camera.size[0]}x{camera.size[1]}, in use" if camera.size else "free"
        lines.append(f"  {camera.node}  {camera.label} ({owner}, {use})")
    if not any(camera.ours for camera in cameras):
        lines.append(f"  none of ours: run {modprobe_command(label)}")
    return lines
