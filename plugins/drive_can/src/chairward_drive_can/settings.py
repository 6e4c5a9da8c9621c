"""What a chair file says about its CAN controller: `[drive.can]`, with one table for its dialect."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from chairward.components import SILENCE_LIMIT_MS, DriveSettings, Settings

Takeover = Literal["listen", "follow", "jsm_error", "emulate"]
SignalName = Annotated[str, Field(pattern=r"^\w+\.\w+$")]


class RnetSettings(Settings):
    """R-Net: whose joystick frames ours stand in for, and how."""

    takeover: Takeover = Field(
        default="listen", description="how motion gets on the bus; 'listen' never sends (the default)"
    )
    hazard_accepted: str = Field(
        default="", description="the takeover's hazard, word for word, once the integrator has read it"
    )
    device: int = Field(default=1, ge=0, le=15, description="device number of the joystick module (the M of 02000M00)")
    speed_percent: int = Field(
        default=20, ge=0, le=100, description="the chair's speed setting that full_* was measured at"
    )
    invert_y: bool = Field(default=False, description="true where a chair's joystick counts backward as positive")
    heartbeats_well: list[int] = Field(
        default=[0xC0, 0xC1],
        description="values of the power module's heartbeat that mean 'well'; others stop the chair",
    )
    settle_ms: int = Field(
        default=1000, ge=300, le=10_000, description="how long the joystick must have been centred to arm"
    )
    serial: str = Field(
        default="", pattern=r"^([0-9a-fA-F]{16})?$", description="emulate: the joystick's serial, 8 bytes in hex"
    )
    startup: str = Field(
        default="", description="emulate: recording of this chair's own start-up (chairward can monitor --log)"
    )


class DbcSettings(Settings):
    """Any controller a DBC file describes; signals are "Message.Signal"."""

    file: str = Field(default="", description="the DBC file")
    forward: SignalName = Field(default="Drive.Forward", description="signal for forward (+) and backward (-)")
    turn: SignalName = Field(default="Drive.Turn", description="signal for left (+) and right (-)")
    forward_per_mm_s: float = Field(default=0.001, description="signal units for 1 mm/s; negative turns the axis round")
    turn_per_deg_s: float = Field(
        default=0.017453292519943295, description="signal units for 1 deg/s; negative turns it round"
    )
    enable: SignalName | None = Field(default=None, description="signal that lets the controller move")
    enable_on: int = Field(default=1, description="its raw value when armed")
    enable_off: int = Field(default=0, description="its raw value otherwise")
    enable_stop: int | None = Field(default=None, description="its raw value for a hard stop, where there is one")
    counter: SignalName | None = Field(default=None, description="signal that counts frames, wrapping")
    checksum: SignalName | None = Field(default=None, description="signal that protects its message; one whole byte")
    checksum_kind: Literal["xor8", "sum8", "crc8_j1850", "crc8_autosar"] = Field(
        default="crc8_j1850", description="over all other bytes of the message, in order"
    )
    cycle_ms: int = Field(default=0, ge=0, le=100, description="0: GenMsgCycleTime of the file")
    status_ms: int = Field(
        default=0, ge=0, le=200, description="longest gap between the controller's messages; 0: two cycles"
    )
    fixed: dict[SignalName, float] = Field(default_factory=dict, description="other signals of the messages we send")
    speed: SignalName | None = Field(default=None, description="status: measured speed")
    speed_mm_s_per_unit: float = Field(default=1000.0, description="mm/s for 1 unit of `speed`")
    turning: SignalName | None = Field(default=None, description="status: measured turn rate")
    turning_deg_s_per_unit: float = Field(default=57.29577951308232, description="deg/s for 1 unit of `turning`")
    fault: SignalName | None = Field(default=None, description="status: anything but 0 is a fault")
    stopped_by_user: SignalName | None = Field(
        default=None, description="status: a stop input or the joystick is active"
    )
    armed: SignalName | None = Field(default=None, description="status: not 0 when the controller accepts motion")
    battery: SignalName | None = Field(default=None, description="status: charge")
    battery_full: float = Field(default=100.0, gt=0, description="value of `battery` when full")
    charging: SignalName | None = Field(default=None, description="status: not 0 with a charger connected")


class Node(Settings):
    """One CiA 402 motor controller."""

    id: int = Field(ge=1, le=127, description="CANopen node id")
    side: Literal["left", "right"] = Field(description="which wheel it turns")
    sign: Literal[-1, 1] = Field(default=1, description="-1 where a positive velocity turns the wheel backward")


class Cia402Settings(Settings):
    """Two CANopen motor controllers, one a wheel."""

    nodes: list[Node] = Field(
        default=[Node(id=1, side="left"), Node(id=2, side="right", sign=-1)],
        description="one node for each driven wheel",
    )
    host_id: int = Field(default=127, ge=1, le=127, description="our own node id: the controllers watch its heartbeat")
    track_mm: float = Field(default=560.0, ge=200, le=1500, description="distance between the driven wheels")
    units_per_mm_s: float = Field(
        default=1.0, gt=0, le=1e6, description="velocity units (0x60FF) for 1 mm/s at the wheel"
    )
    period_ms: int = Field(default=20, ge=5, le=50, description="how often a velocity is sent")
    rpdo_timeout_ms: int = Field(
        default=100, ge=20, le=SILENCE_LIMIT_MS, description="controller stops after so long without"
    )
    heartbeat_ms: int = Field(
        default=50, ge=20, le=200, description="heartbeat, ours and theirs; missed for three times: stop"
    )
    accel_mm_s2: float = Field(default=500.0, gt=0, le=5000, description="profile acceleration (0x6083)")
    decel_mm_s2: float = Field(default=800.0, gt=0, le=5000, description="profile deceleration (0x6084)")
    quick_stop_mm_s2: float = Field(default=1500.0, gt=0, le=8000, description="quick stop deceleration (0x6085)")
    answer_ms: int = Field(default=100, ge=20, le=1000, description="longest wait for one set-up answer")

    @model_validator(mode="after")
    def _two_wheels(self) -> Self:
        if sorted(node.side for node in self.nodes) != ["left", "right"]:
            raise ValueError("cia402.nodes must name one node for the left wheel and one for the right")
        if len({node.id for node in self.nodes} | {self.host_id}) != 3:
            raise ValueError("cia402.nodes and cia402.host_id must all be different")
        return self


class CanSettings(DriveSettings):
    """A CAN controller: where it is, what it speaks, and what its motion amounts to."""

    dialect: Literal["rnet", "dbc", "cia402"] = Field(description="what the controller speaks")
    interface: str = Field(
        default="socketcan", description="slcan, or any of python-can's: socketcan, udp_multicast, virtual"
    )
    channel: str = Field(
        default="can0", description="interface name, serial port by-id, multicast group; {run} = run folder"
    )
    bitrate: int = Field(default=125_000, ge=10_000, le=1_000_000, description="bit/s (socketcan: set by ip link)")
    tty_baudrate: int = Field(default=115_200, ge=9600, le=3_000_000, description="slcan: baud rate of the serial line")
    acknowledged: bool = Field(
        default=False, description="slcan: the adapter answers each frame; then two unanswered are the most"
    )
    options: dict[str, str | int | float | bool] = Field(default_factory=dict, description="more for python-can's Bus")
    full_forward_mm_s: float = Field(
        default=500.0, gt=0, le=3000, description="speed at full deflection; more is refused"
    )
    full_backward_mm_s: float = Field(default=300.0, gt=0, le=3000, description="backward speed at full deflection")
    full_turn_deg_s: float = Field(
        default=45.0, gt=0, le=180, description="turn rate at full deflection; more is refused"
    )
    drive_sign: Literal[-1, 1] = Field(default=1, description="-1 where the chair goes backward when told forward")
    turn_sign: Literal[-1, 1] = Field(default=1, description="-1 where the chair turns right when told left")
    deadband: float = Field(
        default=0.0, ge=0, le=0.3, description="deflection up to which the chair stays still (fraction)"
    )
    accel_mm_s2: float = Field(
        default=500.0,
        ge=0,
        le=5000,
        description="the most that speed rises, half of it in the first tenth; 0: the controller's own ramp alone",
    )
    decel_mm_s2: float = Field(
        default=0.0, ge=0, le=5000, description="controlled stop made here; 0: the controller's own"
    )
    turn_accel_deg_s2: float = Field(default=60.0, ge=0, le=1000, description="as accel_mm_s2, for turning")
    turn_decel_deg_s2: float = Field(default=0.0, ge=0, le=1000, description="as decel_mm_s2, for turning")
    stale_ms: int = Field(default=50, ge=10, le=50, description="a command older than this is never sent")
    link_ms: int = Field(default=300, ge=40, le=2000, description="a controller silent for so long is lost")
    rnet: RnetSettings = Field(default=RnetSettings())
    dbc: DbcSettings = Field(default=DbcSettings())
    cia402: Cia402Settings = Field(default=Cia402Settings())

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.dialect == "dbc" and not self.dbc.file:
            raise ValueError("dialect = 'dbc' needs dbc.file, the DBC file of the controller")
        return self


class SimCanSettings(Settings):
    """Which controller to simulate, and on which bus."""

    dialect: Literal["rnet", "dbc", "cia402"] = Field(default="rnet", description="what the controller speaks")
    interface: str = Field(default="slcan", description="slcan: a pty is made; else an interface of python-can")
    channel: str = Field(default="{run}/can", description="the pty's link, or the channel of the interface")
    bitrate: int = Field(default=125_000, ge=10_000, le=1_000_000, description="bit/s")
    silence_ms: int = Field(default=100, ge=20, le=5000, description="it stops so long after the last command")
    startup_ms: int = Field(default=800, ge=0, le=10_000, description="from power-on until it accepts commands")
    full_percent: int = Field(
        default=20, ge=1, le=100, description="R-Net: speed setting at which it goes at full speed"
    )
    joystick_module: bool = Field(default=True, description="R-Net: with the user's own joystick module")
    dbc: DbcSettings = Field(default=DbcSettings(), description="DBC: the same table as the drive's")
    full_forward: float = Field(default=0.5, gt=0, description="DBC: value of `forward` at full speed")
    full_turn: float = Field(default=0.8, gt=0, description="DBC: value of `turn` at full speed")
