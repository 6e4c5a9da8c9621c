"""Many decisions at once: what the rules leave of a wish, said a second time, for arrays of cases.

It shares no code with the rules, so that each checks the other: `motions` gives what `decide` gives, bit for bit or
nearly (`alone` makes one case into what `decide` takes), and promise P2 can be judged by the ten million.
Rows are cases of one chair; columns of `_mm` are Way's: ahead, behind, left, right. Left out: latches, presses and what
was heard, which a row has behind it, and rule 6's memory but for its vote.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from msgspec.structs import replace as changed
from numpy.typing import NDArray

from chairward.components import Motion
from chairward.facts import MS, Facts, Limits, Near, State
from chairward.messages import Command, RangeReading, Way
from chairward.testing.ride import START_NS, driving, healthy
from chairward.wishes import motion_of

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

DISTANCES_MM = np.array([0, 250, 251, 590, 600, 601, 640, 700, 701, 750, 751, 801, 900, 1_200, 2_000, 5_000, np.inf])
CLOSING_MM_S = np.array([0.0, 0.0, 0.0, 300.0, 1_400.0, 5_000.0])
SPEEDS_MM_S = np.array([0.0, 0.0, 180.0, 500.0, -150.0])
OUTPUTS = np.array([(0, 0), (500, 0), (200, 8), (300, -20), (-150, 0), (0, 20)], float)
DT_S = 0.02
TINY = 1e-9


@dataclass(frozen=True, slots=True)
class Many:
    """N cases of a chair with K sensors.

    wish: which of `states` each case is in, (N,). nearest_mm: of the last three readings, inf where nothing is said,
    (N, K, 4). closing_mm_s, blind (how many of three): (N, K). silent: some required vote is late, (N,). gone:
    what was near a sensor has vanished, (N, K). speed_mm_s: reported, (N,). output: commanded last, (N, 2).
    """

    limits: Limits
    states: Sequence[State]
    wish: NDArray[np.int64]
    nearest_mm: Floats
    closing_mm_s: Floats
    blind: NDArray[np.int64]
    silent: Bools
    gone: Bools
    speed_mm_s: Floats
    output: Floats


def some(rng: np.random.Generator, limits: Limits, cases: int, *, trouble: float = 0.2) -> Many:
    """Random cases, with distances at and beside the thresholds; where there is no trouble nothing is near."""
    shape = (cases, len(limits.sensors))
    stick = _with_wish(driving(), stick=(0.5, -0.5), held=True, at_ns=START_NS - 100 * MS)
    arc = changed(driving(Command.LEFT), base=driving().wish)
    states = [driving(), driving(), driving(Command.BACK), driving(Command.LEFT), driving(Command.RIGHT), arc, stick]
    odd = rng.random((*shape, 4)) < trouble
    return Many(
        limits=changed(limits, near_loss_mm=-1),
        states=states,
        wish=rng.integers(len(states), size=cases),
        nearest_mm=np.where(odd, rng.choice(DISTANCES_MM, odd.shape), 5_000.0),
        closing_mm_s=np.where(rng.random(shape) < trouble, rng.choice(CLOSING_MM_S, shape), 0.0),
        blind=np.where(rng.random(shape) < trouble / 2, rng.integers(4, size=shape), 0),
        silent=rng.random(cases) < trouble / 8,
        gone=rng.random(shape) < trouble / 8,
        speed_mm_s=rng.choice(SPEEDS_MM_S, cases),
        output=OUTPUTS[rng.integers(len(OUTPUTS), size=cases)],
    )


def _with_wish(state: State, **changes: Any) -> State:
    assert state.wish is not None
    return changed(state, wish=changed(state.wish, **changes))


def worse(rng: np.random.Generator, many: Many, *, share: float = 1.0, kinds: int = 5) -> Many:
    """The same cases, a share of them worse in one thing: nearer, closing, blind, silent, or (the fifth) vanished."""
    cases, sensors = many.closing_mm_s.shape
    rows, which = np.arange(cases), rng.integers(sensors, size=cases)
    kind = np.where(rng.random(cases) < share, rng.integers(kinds, size=cases), -1)
    way = rng.integers(4, size=cases)
    nearest, closing = many.nearest_mm.copy(), many.closing_mm_s.copy()
    blind, gone = many.blind.copy(), many.gone.copy()
    said = nearest[rows, which, way]
    pull = (kind == 0) & np.isfinite(said)  # saying nothing of a way is already the worst that can be said of it
    nearest[rows, which, way] = np.where(pull, np.minimum(said, rng.choice(DISTANCES_MM, cases)), said)
    closing[rows, which] = np.where(
        kind == 1, np.minimum(5_000.0, closing[rows, which] + 4_500.0), closing[rows, which]
    )
    blind[rows, which] = np.where(kind == 2, np.minimum(3, blind[rows, which] + 1), blind[rows, which])
    silent = many.silent | (kind == 3)
    gone[rows, which] |= kind == 4
    return replace(many, nearest_mm=nearest, closing_mm_s=closing, blind=blind, gone=gone, silent=silent)


def allowed(many: Many) -> Floats:
    """The most each way that all rules together allow, (N, 4): forward, backward, left, right."""
    limits, nearest = many.limits, many.nearest_mm
    ahead, behind, left, right = (nearest[:, :, way] for way in range(4))
    stop, avoid, swing = limits.stop_mm, limits.avoid_mm, limits.turn_clear_mm
    covers = _covers(limits)
    watched = (covers & np.isfinite(nearest)).any(axis=1)
    most = np.where(watched, np.array(limits.caps), np.minimum(limits.caps, limits.unseen))
    room_ahead, room_behind, still = ahead - stop, behind - stop, np.zeros_like(ahead)
    speed = many.speed_mm_s[:, None]
    forward = np.minimum(most[:, 0], _towards(room_ahead, speed, many.closing_mm_s, limits).min(axis=1))
    backward = np.minimum(most[:, 1], _towards(room_behind, -speed, still, limits).min(axis=1))
    forward = np.where(((stop < ahead) & (ahead <= avoid)).any(axis=1), np.minimum(forward, limits.avoid_mm_s), forward)
    toes = (ahead <= swing).any(axis=1)
    forward[many.gone.any(axis=1)] = 0.0
    caps: Floats = np.stack(
        [
            forward,
            backward,
            np.where(toes | (left <= swing).any(axis=1), 0.0, most[:, 2]),
            np.where(toes | (right <= swing).any(axis=1), 0.0, most[:, 3]),
        ],
        axis=1,
    )
    caps = np.minimum(caps, _blind(many).min(axis=1))
    caps[many.silent] = 0.0
    return caps


def _covers(limits: Limits) -> Bools:
    """Which sensor is to cover which way, (K, 4)."""
    return np.array([[way in need.covers for way in Way] for need in limits.sensors.values()])


def spent(many: Many) -> Bools:
    """Whose forward wish ends with this decision: something closes the way ahead that is more than a short gap."""
    limits, ahead = many.limits, many.nearest_mm[:, :, 0]
    covers = _covers(limits)[:, 0]
    stops = _towards(ahead - limits.stop_mm, many.speed_mm_s[:, None], many.closing_mm_s, limits) == 0.0
    stops |= many.gone | ((many.blind == 3) & (_blind(many)[:, :, 0] == 0.0))
    unseen = ~(covers & np.isfinite(ahead)).any(axis=1) & (limits.unseen.forward_mm_s == 0.0)
    ends: Bools = stops.any(axis=1) | unseen
    return ends


def _towards(room_mm: Floats, speed_mm_s: Floats, closing_mm_s: Floats, limits: Limits) -> Floats:
    """Rules 2 and 3: as fast as the chair can still stop in the room."""
    t, a = limits.reaction_s, limits.decel_mm_s2

    def largest(room: Floats, reaction_s: Floats | float) -> Floats:
        root = np.sqrt(np.square(reaction_s) + 2.0 * np.maximum(room, 0.0) / a)
        return np.where(room > 0.0, a * (root - reaction_s), 0.0)

    cap = largest(room_mm - closing_mm_s * t - a * t * t / 2.0, t + closing_mm_s / a)
    creep = np.minimum(60.0, largest(np.array(100.0), t))
    cap = np.where(closing_mm_s > 0.0, cap, np.maximum(cap, creep))
    too_fast = (speed_mm_s > 60.0) & (speed_mm_s**2 / (2.0 * a) > room_mm)
    return np.where((room_mm <= 0.0) | too_fast, 0.0, cap)


def _blind(many: Many) -> Floats:
    """Rule 5: the ways that a blind sensor covers are unseen; ahead it may crawl while one of another lane sees."""
    limits, lanes = many.limits, [name.split("/")[0] for name in many.limits.sensors]
    covers = _covers(limits)
    sees = (many.blind == 0) & np.isfinite(many.nearest_mm[:, :, 0]) & covers[:, 0]
    caps = np.full((*many.blind.shape, 4), np.inf)
    for k, lane in enumerate(lanes):
        unseen = np.where(covers[k], np.array(limits.unseen), np.inf) + np.zeros((len(many.blind), 1))
        others = [nth for nth, other in enumerate(lanes) if other != lane]
        if covers[k, 0] and others:
            crawl = max(limits.unseen[0], limits.crawl_mm_s)
            unseen[:, 0] = np.where(sees[:, others].any(axis=1), crawl, unseen[:, 0])
        caps[:, k] = np.where(many.blind[:, k, None] > 0, unseen, np.inf)
    return caps


def motions(many: Many) -> Floats:
    """What the chair does in each case, (N, 2): mm/s and deg/s."""
    limits, caps = many.limits, allowed(many)
    want = np.array([motion_of(state, limits) for state in many.states])[many.wish]
    front = np.array([_goes_straight(state) for state in many.states])[many.wish]
    side = _freer_side(many)
    room = np.where(side > 0.0, caps[:, 2], caps[:, 3])
    steers = front & (side != 0.0) & (room >= limits.steer_deg_s) & (caps[:, 0] > 0.0) & (limits.steer_deg_s > 0.0)
    slow = np.minimum(want[:, 0], caps[:, 0])
    want = np.where(steers[:, None], np.stack([slow, side * limits.steer_deg_s], axis=1), want)
    target = _fit(want, caps)
    rise = np.array([limits.accel_mm_s2, limits.turn_accel_deg_s2]) * DT_S
    most = np.abs(many.output) + rise
    ramped = np.where(many.output * target < 0.0, 0.0, np.clip(target, -most, most))
    reverses = (many.speed_mm_s * ramped[:, 0] < 0.0) & (np.abs(many.speed_mm_s) > 20.0)
    ramped[(target[:, 0] != 0.0) & (reverses | (ramped[:, 0] == 0.0))] = 0.0
    return _fit(ramped, caps)


def _goes_straight(state: State) -> bool:
    return state.wish is not None and state.wish.command is Command.FRONT and state.wish.stick is None


def _freer_side(many: Many) -> Floats:
    """Rule 4: +1 left, -1 right, 0 where the sensors in the avoid zone do not all sense the same side clear."""
    ahead, left, right = (many.nearest_mm[:, :, way] for way in (0, 2, 3))
    left, right = (np.where(np.isinf(side), 0.0, side) for side in (left, right))
    near = (many.limits.stop_mm < ahead) & (ahead <= many.limits.avoid_mm)
    clear = (np.maximum(left, right) > many.limits.avoid_mm) & (left != right)
    each = np.where(clear, np.sign(left - right), 0.0)
    high = np.where(near, each, -np.inf).max(axis=1)
    low = np.where(near, each, np.inf).min(axis=1)
    return np.where(near.any(axis=1) & (high == low), high, 0.0)


def _fit(motion: Floats, caps: Floats) -> Floats:
    """Scaled as a whole until it is within the caps."""
    wanted = np.stack([motion[:, 0], -motion[:, 0], motion[:, 1], -motion[:, 1]], axis=1)
    over = wanted > caps
    scales = np.where(over, caps / np.where(over, wanted, 1.0), 1.0)
    fitting: Floats = motion * scales.min(axis=1)[:, None]
    return fitting


def no_faster(worse: Floats, better: Floats, steer_deg_s: float) -> Bools:
    """`laws.no_faster` for each row."""
    turn = np.maximum(np.abs(better[:, 1]), np.where(better[:, 0] > 0.0, steer_deg_s, 0.0))
    same_way = worse[:, 0] * better[:, 0] >= 0.0
    slower = np.abs(worse[:, 0]) <= np.abs(better[:, 0]) * (1 + TINY)
    return same_way & slower & (np.abs(worse[:, 1]) <= turn * (1 + TINY))


def alone(many: Many, row: int) -> tuple[State, Facts]:
    """One case as `decide` takes it."""
    ranges = {}
    for k, name in enumerate(many.limits.sensors):
        ahead, behind, left, right = (int(mm) if np.isfinite(mm) else None for mm in many.nearest_mm[row, k])
        ranges[name] = tuple(
            RangeReading(
                seq=nth,
                captured_ns=START_NS - (160 - 33 * nth) * MS,
                can_see=bool(nth > many.blind[row, k]),
                ahead_mm=ahead,
                behind_mm=behind,
                left_mm=left,
                right_mm=right,
                closing_mm_s=int(many.closing_mm_s[row, k]),
            )
            for nth in (1, 2, 3)
        )
    facts = healthy(many.limits, ranges=ranges)
    heard_ns = facts.now_ns - (300 if many.silent[row] else 10) * MS  # a short gap: all ways close, the wish waits
    drive = changed(facts.drive, speed_mm_s=float(many.speed_mm_s[row]), at_ns=heard_ns)
    gone = Near(distance_mm=700, seen_ns=START_NS - 500 * MS, gone=True)
    near = {name: gone for k, name in enumerate(many.limits.sensors) if many.gone[row, k]}
    return changed(many.states[many.wish[row]], output=Motion(*many.output[row].tolist()), near=near), changed(
        facts, drive=drive
    )
