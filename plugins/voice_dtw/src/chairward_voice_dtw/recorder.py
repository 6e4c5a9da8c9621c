"""One repetition from a live microphone: 2.5 s, with a level meter. PortAudio is loaded here and nowhere else."""

from __future__ import annotations

from typing import Any

import numpy as np
import typer

from chairward_voice_dtw.audio import Floats, SoundError
from chairward_voice_dtw.streams import STREAM_HZ

SECONDS = 2.5


def find_input(device: str) -> tuple[Any, int | str | None]:
    """The sounddevice module, and the input as it takes it. Raises SoundError when there is none, saying what to do."""
    try:
        import sounddevice
    except ImportError:
        raise SoundError("recording needs the microphone plugin (chairward-microphone)") from None
    except OSError:
        raise SoundError("the PortAudio library is missing: install it with 'sudo apt install libportaudio2'") from None
    wanted = int(device) if device.isdigit() else device or None
    inputs: list[str] = []
    try:
        inputs += [f"{i} '{d['name']}'" for i, d in enumerate(sounddevice.query_devices()) if d["max_input_channels"]]
        if not inputs:
            raise SoundError("this machine has no sound input at all: plug a microphone in")
        sounddevice.check_input_settings(device=wanted, samplerate=STREAM_HZ, channels=1, dtype="float32")
    except (sounddevice.PortAudioError, ValueError) as error:
        known = f"there are: {', '.join(inputs)}"
        raise SoundError(f"microphone '{device or 'default'}': {error} ({known}): choose one by --device") from None
    return sounddevice, wanted


def record_once(device: str) -> Floats:
    """Mono float32 at STREAM_HZ. Raises SoundError when there is no microphone or it gives up."""
    sounddevice, wanted = find_input(device)
    parts: list[Floats] = []
    try:
        with sounddevice.InputStream(device=wanted, samplerate=STREAM_HZ, channels=1, dtype="float32") as stream:
            for _ in range(int(SECONDS * 10)):
                data, _overflowed = stream.read(STREAM_HZ // 10)
                parts.append(np.asarray(data[:, 0], np.float32))
                typer.echo(f"\r{meter(parts[-1])}", nl=False, err=True)
    except (sounddevice.PortAudioError, ValueError) as error:
        raise SoundError(f"microphone '{device or 'default'}': {error}: plug it in again and retry") from None
    typer.echo("", err=True)
    return np.concatenate(parts)


def meter(samples: Floats, width: int = 40) -> str:
    """A bar of the level from -60 dBFS to full scale."""
    level = 20.0 * float(np.log10(np.sqrt(np.mean(samples**2)) + 1e-6))
    filled = int(np.clip((level + 60.0) / 60.0, 0.0, 1.0) * width)
    return f"[{'#' * filled}{' ' * (width - filled)}] {level:5.0f} dBFS"
