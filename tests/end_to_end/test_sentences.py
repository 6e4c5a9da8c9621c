"""Bad input gets one readable sentence with file and key or device; nothing moves, nothing is lost."""

from __future__ import annotations

import shutil
import wave
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.timeout(120)


@pytest.fixture
def profiles(tmp_path: Path) -> Path:
    """A copy of the shipped profiles to spoil, beside the plugins: chair files name paths relative to themselves."""
    folder = tmp_path / "profiles"
    shutil.copytree(ROOT / "profiles", folder)
    (tmp_path / "plugins").symlink_to(ROOT / "plugins")
    return folder


def spoil(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


def refused(ended: Any, *parts: str) -> None:
    assert ended.code == 2, ended.err[-2000:]
    assert "Traceback" not in ended.err
    assert len(ended.sentence) < 500
    for part in parts:
        assert part in ended.sentence


def test_a_value_that_would_loosen_the_chair(command: Callable[..., Any], profiles: Path) -> None:
    file = profiles / "people" / "demo.toml"
    file.write_text(file.read_text() + "\n[limits]\nstop_mm = 500\n")
    ended = command("run", "--chair", "sim", "--for", "1s", CHAIRWARD_PROFILES=str(profiles))
    refused(ended, "demo.toml", "stop_mm", "500", "600")


def test_a_plugin_that_is_not_installed(command: Callable[..., Any], profiles: Path) -> None:
    spoil(profiles / "chairs" / "sim.toml", '"vision_obstacle"', '"lidar_ring"')
    ended = command("run", "--chair", "sim", "--for", "1s", CHAIRWARD_PROFILES=str(profiles))
    refused(ended, "sim.toml", "lidar_ring", "install")


def test_a_stage_out_of_order(command: Callable[..., Any], profiles: Path) -> None:
    spoil(profiles / "chairs" / "sim.toml", '["stereo_range", "vision_obstacle"]', '["voice_dtw", "stereo_range"]')
    ended = command("run", "--chair", "sim", "--for", "1s", CHAIRWARD_PROFILES=str(profiles))
    refused(ended, "sim.toml", "voice_dtw", "AudioBlock")


def test_a_file_that_is_not_toml(command: Callable[..., Any], profiles: Path) -> None:
    (profiles / "chairs" / "sim.toml").write_text("name = 'sim\nkind = 'x'\n")
    refused(command("run", "--chair", "sim", "--for", "1s", CHAIRWARD_PROFILES=str(profiles)), "sim.toml", "line 1")


def test_a_setting_that_does_not_exist(command: Callable[..., Any]) -> None:
    refused(command("demo", "--for", "1s", "--set", "stereo_range.metod=bm"), "stereo_range.metod")


def test_a_chair_nobody_has_heard_of(command: Callable[..., Any]) -> None:
    refused(command("run", "--chair", "throne", "--for", "1s"), "throne")


@pytest.mark.processes
def test_a_serial_port_that_is_not_there(command: Callable[..., Any], tmp_path: Path) -> None:
    port = tmp_path / "ttyUSB7"
    ended = command("demo", "--for", "3s", "--json", "--no-record", "--set", f"pic_serial.port={port}", timeout_s=110.0)
    assert ended.json["driven_m"] == 0.0
    assert str(port) in " ".join(ended.json["latched"] + ended.json["reasons_at_end"])


@pytest.mark.processes
def test_a_machine_without_cameras(command: Callable[..., Any], tmp_path: Path) -> None:
    ended = command(
        *("run", "--chair", "prototype", "--person", "thesis", "--for", "3s", "--json", "--no-record"),
        *("--set", f"pic_serial.port={tmp_path / 'tty'}", "--set", f"cameras.left={tmp_path / 'video0'}"),
        *("--set", f"cameras.right={tmp_path / 'video1'}", "--set", "pic_serial.watchdog_relay=K1"),
        timeout_s=110.0,
    )
    assert ended.json["driven_m"] == 0.0
    assert str(tmp_path / "video0") in " ".join([*ended.json["reasons_at_end"], *ended.json["events"]])


@pytest.mark.processes
@pytest.mark.needs_shared
def test_a_sound_file_that_is_not_what_it_says(command: Callable[..., Any], tmp_path: Path, shared_data: Path) -> None:
    broken = tmp_path / "word.wav"
    with wave.open(str(broken), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(300)
        file.writeframes(b"\0\0" * 100)
    ended = command(
        *("run", "--chair", "files", "--for", "3s", "--json", "--no-record"),
        *("--set", f"cameras.manifest={shared_data / 'stereo' / 'manifest.csv'}"),
        *("--set", f"microphone.manifest={shared_data / 'voice' / 'manifest.csv'}"),
        *("--set", "microphone.kind=files", "--set", f'microphone.files=["{broken}"]'),
        timeout_s=110.0,
    )
    assert ended.code == 2 or ended.json["driven_m"] == 0.0
    assert "word.wav" in ended.sentence + ended.out
    assert "300" in ended.sentence + ended.out
