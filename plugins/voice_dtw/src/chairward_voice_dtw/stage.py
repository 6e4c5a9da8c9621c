"""The recogniser as a stage of a lane: sound blocks from the bench in, Intent and Alive out."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from chairward.components import Bench, Context
from chairward.messages import Alive, Command, Intent, Message
from chairward.sound_pane import RecentSound
from chairward.speaking import Listener
from chairward.stages import AudioBlock
from chairward.talk_switch import TalkListener
from chairward_voice_dtw import calibration, drift
from chairward_voice_dtw.audio import RATE_HZ, Floats, SoundError, read_wav
from chairward_voice_dtw.engine import DtwEngine, Engine, Heard, ThesisEngine, Thresholds, Voice
from chairward_voice_dtw.gate import Gate
from chairward_voice_dtw.level import LevelMeter
from chairward_voice_dtw.settings import EngineName, VoiceSettings
from chairward_voice_dtw.store import StoreError, WordStore
from chairward_voice_dtw.streams import STREAM_HZ, active_rms
from chairward_voice_dtw.templates import files_of_folder, files_of_manifest, from_files

HEARTBEAT_NS = 100_000_000
DEAD_NS = 300_000_000
WARM_UP_S = 3


def template_files(settings: VoiceSettings, person_dir: Path) -> dict[str, list[Path]]:
    """Recordings by word, from where the settings say. Raises SoundError, StoreError."""
    if settings.manifest is not None:
        return files_of_manifest(settings.manifest, settings.speaker)
    if settings.templates_dir is not None:
        return files_of_folder(settings.templates_dir)
    return WordStore(person_dir, settings.word_set).files()


def level_dbfs(files: Sequence[Path]) -> float:
    """How loud recordings are, the median of their loud parts. Raises SoundError."""
    return float(np.median([20.0 * np.log10(active_rms(read_wav(path, STREAM_HZ)[0])) for path in files]))


class EngineMaker:
    """A person's templates, loaded once; engines for whatever rate the sound turns out to have."""

    def __init__(
        self,
        files: Mapping[str, Sequence[Path]],
        thresholds: Thresholds,
        engine: EngineName,
        *,
        embedding: bool = True,
        weights: Path = calibration.FILE,
    ) -> None:
        self._thresholds, self._engine = thresholds, engine
        self._voice: Voice | None = None
        self._recordings: dict[str, Floats] = {}
        if engine == "default":
            self._voice = Voice(from_files(files), embedding=embedding, weights=weights)
        else:
            self._recordings = {word: read_wav(paths[0], RATE_HZ)[0] for word, paths in files.items()}

    def make(self, rate_hz: int, *, at_once: bool = False) -> Engine:
        """A fresh engine for sound of that rate; at_once: quicker for long blocks (an evaluation's).

        Raises SoundError for a rate that cannot be used.
        """
        if self._voice is not None:
            return DtwEngine(self._voice, self._thresholds, rate_hz, at_once=at_once)
        stop_word = min(self._thresholds.stop_words, default="")
        return ThesisEngine(self._recordings, stop_word, "text" if self._engine == "thesis_text" else "code", rate_hz)

    def warm_up(self) -> None:
        """Run every compiled function once, on a made-up word, so that no frame of a live lane waits for a compiler."""
        rng = np.random.default_rng(0)
        sound = rng.normal(0.0, 1e-3, WARM_UP_S * STREAM_HZ)
        sound[STREAM_HZ : STREAM_HZ + STREAM_HZ // 2] += rng.normal(0.0, 0.1, STREAM_HZ // 2)
        engine = self.make(STREAM_HZ)
        engine.push(sound.astype(np.float32))


class VoiceStage:
    """Needs AudioBlock; gives Intent and, every 100 ms of sound (or of silence of the source), Alive.

    Intent.captured_ns is the time of the word's *end*: a word is no measurement that ages while it is spoken; how fresh
    hearing is, Alive tells (its captured_ns is the newest sample's time). Without an enrolled stop word nothing moves.
    """

    def __init__(self, settings: VoiceSettings, context: Context) -> None:
        self._settings = settings
        self._commands = {word: Command(command) for word, command in context.words.items()}
        stop_words = frozenset(word for word, command in self._commands.items() if command is Command.STOP)
        thresholds = Thresholds(word=settings.threshold, stop=settings.stop_threshold, stop_words=stop_words)
        self._unable = ""
        self._maker: EngineMaker | None = None
        self._loudest_noise_dbfs = settings.loudest_noise_dbfs
        try:
            files = template_files(settings, context.person_dir)
            known = {w: paths for w, paths in files.items() if w in self._commands or w == settings.wake_word}
            if not stop_words & known.keys():
                who = context.person or "this person"
                self._unable = f"{who} has no enrolled stop word: record one with 'chairward words record'"
            else:
                self._maker = EngineMaker(known, thresholds, settings.engine)
                self._maker.warm_up()
                self._loudest_noise_dbfs = min(
                    settings.loudest_noise_dbfs,
                    level_dbfs([path for w in stop_words & known.keys() for path in known[w]])
                    - settings.voice_over_noise_db,
                )
        except (SoundError, StoreError) as error:
            self._unable = str(error)
        self._engine: Engine | None = None
        self._meter: LevelMeter | None = None
        self._rate_hz = 0
        self._recent = RecentSound()
        self._chair_voice = Listener(context.run_dir)
        self._switch = TalkListener(context.run_dir)
        self._gate = Gate(settings)
        self._drift_folder = (
            None
            if settings.manifest or settings.templates_dir
            else WordStore(context.person_dir, settings.word_set).folder
        )
        self._scores: list[float] = []
        self._seq = 0
        self._beat_ns = 0
        self._sound_ns = 0
        self._lost_s = -1.0
        self._spoke_s = -1.0
        self._last_motion_ns = 0
        self._shouted = False

    def process(self, bench: Bench) -> list[Message]:
        """One block of sound, or none (the source had nothing in time)."""
        block = bench.get(AudioBlock)
        if block is None:
            return self._silent_source(time.monotonic_ns())
        messages: list[Message] = []
        self._sound_ns = block.captured_ns + len(block.samples) * 1_000_000_000 // block.rate_hz
        if block.rate_hz != self._rate_hz:
            self._begin(block.rate_hz)
        self._recent.push(block)
        if self._switch.is_held(block.captured_ns):
            self._gate.hold(block.captured_ns)
        if self._meter is not None:
            self._meter.push(block.samples)
            if self._meter.shout and not self._shouted:
                messages.append(self._stop_of_a_shout())
            self._shouted = self._meter.shout
        if self._engine is not None:
            if block.lost_samples:
                self._lost_s = self._engine.now_s
            if block.chair_speaks or self._chair_voice.is_speaking(block.captured_ns):
                self._spoke_s = self._engine.now_s
            for heard in self._engine.push(block.samples):
                intent = self._intent(heard)
                if intent is not None:
                    messages.append(intent)
        if self._sound_ns - self._beat_ns >= HEARTBEAT_NS:
            messages.append(self._alive(self._sound_ns))
            if (pane := self._recent.pane()) is not None:
                bench.put(pane)
        return messages

    def close(self) -> None:
        """Let go of what other processes share; note how well the words fitted their recordings."""
        self._chair_voice.close()
        self._switch.close()
        if self._drift_folder is not None and self._drift_folder.is_dir():
            drift.note(self._drift_folder, datetime.now(UTC).date(), self._scores)
            self._scores = []

    def _begin(self, rate_hz: int) -> None:
        """The first block, or a device that came back with another rate."""
        self._rate_hz = rate_hz
        self._engine = None
        self._meter = LevelMeter(
            rate_hz, loudest_noise_dbfs=self._loudest_noise_dbfs, shout_dbfs=self._settings.shout_dbfs
        )
        if self._maker is not None:
            try:
                self._engine = self._maker.make(rate_hz)
            except SoundError as error:
                self._unable = str(error)

    def _silent_source(self, now_ns: int) -> list[Message]:
        if now_ns - self._beat_ns < HEARTBEAT_NS:
            return []
        self._beat_ns = now_ns
        self._seq += 1
        reason = self._unable
        if not reason and now_ns - self._sound_ns > DEAD_NS:
            reason = "no sound arrives from the microphone"
        return [Alive(seq=self._seq, captured_ns=now_ns, well=not reason, reason=reason[:200])]

    def _alive(self, now_ns: int) -> Alive:
        assert self._meter is not None
        health = self._meter.health()
        self._beat_ns = now_ns
        self._seq += 1
        reason = self._unable or health.reason
        return Alive(
            seq=self._seq,
            captured_ns=now_ns,
            well=not reason,
            level_dbfs=health.level_dbfs,
            noise_dbfs=health.noise_dbfs,
            clipping=health.clipping,
            reason=reason[:200],
        )

    def _stop_of_a_shout(self) -> Intent:
        self._seq += 1
        return Intent(seq=self._seq, captured_ns=self._sound_ns, command=Command.STOP, word="(a shout)")

    def _intent(self, heard: Heard) -> Intent | None:
        """What a heard word means now, if anything: stop always, motion words only where they may be trusted."""
        if not heard.accepted:
            return None
        assert self._engine is not None
        end_ns = self._sound_ns - int((self._engine.now_s - heard.end_s) * 1e9)
        self._scores.append(heard.score)
        if heard.word == self._settings.wake_word:
            self._gate.wake(end_ns)
        command = self._commands.get(heard.word)
        if command is None:
            return None
        if command not in (Command.STOP, Command.HELP):
            onset_ns = end_ns - int((heard.end_s - heard.onset_s) * 1e9)
            closed = not self._gate.lets_pass(onset_ns, end_ns)
            soon = 0 < end_ns - self._last_motion_ns < self._settings.refractory_ms * 1_000_000
            broken = self._lost_s >= heard.onset_s - 0.1 or self._spoke_s >= heard.onset_s - 0.1
            unwell = self._meter is not None and not self._meter.health().well
            if closed or soon or broken or unwell:
                return None
            self._last_motion_ns = end_ns
        self._seq += 1
        confidence = 1.0 / (1.0 + float(np.exp(-np.clip(heard.score, -50.0, 50.0))))
        return Intent(
            seq=self._seq, captured_ns=max(0, end_ns), command=command, word=heard.word[:200], confidence=confidence
        )
