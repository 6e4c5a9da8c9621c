"""The drive in a process of its own, in real time, killed and stopped while it drives; and the programs people run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from chairward.shared_state import PIN_NAMES, SharedState
from chairward_drive_can import rnet
from chairward_drive_can.frames import Frame
from chairward_drive_can.partners.rnet import RnetChair
from chairward_drive_can.partners.run import AdapterPty, serve

pytestmark = pytest.mark.processes  # in real time: a host that is late is rightly not driven on

HOST = Path(__file__).parent / "host.py"
WAIT_S = 20.0


class Chair:
    """A simulated R-Net chair on a pty, living in a thread, and the host process that drives it."""

    def __init__(self, folder: Path, takeover: str) -> None:
        self.model = RnetChair(full_percent=20)
        self.model.body.fall_per_s = 20.0
        self.end = AdapterPty(folder / "can")
        self._stop = threading.Event()
        self._thread = threading.Thread(target=serve, args=(self.model, self.end, self._stop.is_set))
        self._thread.start()
        self.host = subprocess.Popen(
            [sys.executable, HOST, folder / "can", takeover], stdout=subprocess.PIPE, text=True
        )

    def until(self, what: Callable[[], bool]) -> None:
        end = time.monotonic() + WAIT_S
        while not what():
            assert time.monotonic() < end, f"waited {WAIT_S} s in vain"
            self._stop.wait(0.005)

    def driving(self) -> None:
        assert self.host.stdout is not None
        assert self.host.stdout.readline() == "driving\n"
        self.until(lambda: self.model.body.forward > 0.4)
        self.host.send_signal(signal.SIGUSR1)  # it drives: from here on it must not arm again by itself

    def close(self) -> None:
        self.host.send_signal(signal.SIGCONT)
        self.host.kill()
        self.host.communicate()
        self._stop.set()
        self._thread.join()
        self.end.close()


@pytest.fixture(params=["follow", "jsm_error"])
def chair(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Chair]:
    made = Chair(tmp_path, request.param)
    yield made
    made.close()


def test_a_killed_host_leaves_a_standing_chair_and_no_more_frames(chair: Chair) -> None:
    chair.driving()
    chair.host.kill()
    chair.until(lambda: chair.model.body.standing)
    before = chair.model.moves_heard
    time.sleep(0.2)
    assert chair.model.moves_heard == before


def test_a_stopped_and_continued_host_does_not_drive_on_by_itself(chair: Chair) -> None:
    chair.driving()
    chair.host.send_signal(signal.SIGSTOP)
    chair.until(lambda: chair.model.body.standing)
    time.sleep(0.3)
    before = chair.model.moves_heard
    chair.host.send_signal(signal.SIGCONT)
    time.sleep(0.5)
    assert chair.model.moves_heard == before
    assert chair.model.body.standing


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    code = "from chairward.cli.app import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True, timeout=60
    )


def test_the_monitor_prints_a_recording_in_words(tmp_path: Path) -> None:
    import can

    log = tmp_path / "drive.log"
    with can.Logger(log) as writer:
        for number, frame in enumerate(
            [rnet.joystick(1, 0, 50), Frame(0x1C0C0100, b"\x37", True), Frame(0x7B3, remote=True)]
        ):
            writer(
                can.Message(
                    timestamp=1000.0 + number / 100,
                    arbitration_id=frame.id,
                    data=frame.data,
                    is_extended_id=frame.extended,
                    is_remote_frame=frame.remote,
                )
            )
    done = run("can", "monitor", log)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [line.split(None, 2)[2] for line in lines] == [
        "joystick 1: forward 50, right 0",
        "battery 55 %",
        "start-up: serial numbers",
    ]
    assert lines[1].split()[:2] == ["0.010000", "1C0C0100#37"]


def test_the_monitor_says_in_one_sentence_what_it_cannot_read(tmp_path: Path) -> None:
    done = run("can", "monitor", tmp_path / "none.log")
    assert done.returncode == 2
    assert "none.log cannot be read as a CAN recording (No such file or directory): check the path" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_simulated_chair_runs_as_a_program_and_is_seen_live_and_recorded(tmp_path: Path) -> None:
    port, log, motors = tmp_path / "rnet", tmp_path / "seen.log", tmp_path / "pins"
    code = "from chairward.cli.app import main; main()"
    program = subprocess.Popen(
        [sys.executable, "-c", code, "sim", "rnet", "--channel", port, "--pins", motors],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert program.stdout is not None
        assert "simulated rnet on slcan" in program.stdout.readline()
        live = run("can", "monitor", "--interface", "slcan", "--channel", port, "--for", "1.5", "--log", log)
        assert live.returncode == 0, live.stderr
        pins = SharedState.attach(motors, WAIT_S)
        assert pins.names == PIN_NAMES
        assert (pins.read()["drive_duty"], pins.read()["brake"]) == (0.0, 1.0)
        pins.close()
        assert "joystick 1: forward 0, right 0" in live.stdout
        assert "modules alive" in live.stdout
        again = run("can", "monitor", log)
        assert again.stdout.count("joystick 1") == live.stdout.count("joystick 1") > 20
    finally:
        program.send_signal(signal.SIGTERM)
        out, _ = program.communicate(timeout=20)
    assert "motion frames heard: 0" in out
    assert not os.path.lexists(port)


def test_the_takeovers_are_listed_with_their_hazards() -> None:
    done = run("can", "takeovers")
    assert "the joystick will not work" in done.stdout
    assert "listen: only listens" in done.stdout
