"""Who has a device open, by /proc: made-up processes, and a real one."""

from __future__ import annotations

import os
import subprocess
import sys

from relit_camera.devices.device_users import DeviceUser, find_device_users, has_mapped_buffers

NODE = "/dev/video10"


def add_process(proc, pid, *targets, name="chrome", command=("chrome",)):
    folder = proc / str(pid) / "fd"
    folder.mkdir(parents=True)
    (proc / str(pid) / "comm").write_text(name + "\n")
    (proc / str(pid) / "cmdline").write_text("\0".join(command) + "\0")
    for number, target in enumerate(targets):
        (folder / str(number)).symlink_to(target)


def test_whoever_has_the_node_open_is_named_once(tmp_path):
    add_process(tmp_path, 30, "/dev/null", NODE, NODE, name="firefox", command=("/usr/bin/firefox", "-new"))
    add_process(tmp_path, 4, "/dev/video1", "socket:[1]")
    add_process(tmp_path, 200, NODE)
    (tmp_path / "self").symlink_to(tmp_path / "30")
    assert find_device_users(NODE, tmp_path) == [
        DeviceUser(30, "firefox", ("/usr/bin/firefox", "-new")),
        DeviceUser(200, "chrome", ("chrome",)),
    ]
    assert str(find_device_users(NODE, tmp_path)[0]) == "firefox (process 30)"


def test_this_process_is_no_holder(tmp_path):
    add_process(tmp_path, os.getpid(), NODE)
    assert find_device_users(NODE, tmp_path) == []


def test_the_command_relit_is_known_by_its_arguments():
    assert DeviceUser(1, "python3", ("/opt/venv/bin/python3", "/opt/venv/bin/relit", "run")).is_relit_camera
    assert DeviceUser(1, "relit", ("/usr/bin/relit",)).is_relit_camera
    assert not DeviceUser(1, "vim", ("vim", "notes", "relit")).is_relit_camera
    assert not DeviceUser(1, "python3").is_relit_camera


def test_without_proc_nobody_is_seen(tmp_path):
    assert find_device_users(NODE, tmp_path / "none") == []


def test_a_real_process_is_found(tmp_path):
    path = tmp_path / "device"
    path.touch()
    assert find_device_users(str(path)) == []
    program = f"f = open({str(path)!r}); print(flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        assert [holder.pid for holder in find_device_users(str(path))] == [process.pid]
        process.communicate("\n")
    assert find_device_users(str(path)) == []


def test_who_has_a_device_in_memory_is_told_from_who_has_it_open(tmp_path):
    path = tmp_path / "device"
    path.write_bytes(bytes(4096))
    program = f"import mmap; f = open({str(path)!r}, 'r+b'); m = FIRST; print(flush=True); input()"
    for first, mapped in (("mmap.mmap(f.fileno(), 4096)", True), ("None", False)):
        with subprocess.Popen(
            [sys.executable, "-c", program.replace("FIRST", first)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        ) as process:
            assert process.stdout is not None
            process.stdout.readline()
            (holder,) = find_device_users(str(path))
            assert has_mapped_buffers(holder, str(path)) is mapped
            process.communicate("\n")
    assert not has_mapped_buffers(holder, str(path))  # it has ended
