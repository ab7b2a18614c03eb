"""Benches as data: recordings, the columns that feed the model or are compared with it, the numbers to be found."""

from __future__ import annotations

import math
from numbers import Real
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from finger_pin.description.recordings.csv_files import TableFormat
from finger_pin.description.validation import Description, Name, choice, problem, quantity, real, vector

#: What a parameter of one recording begins with, before its name.
OF_RECORDINGS = "recordings."
#: Input of a motion that is given, not computed; what is then no output; and the output that is there then alone.
IMPOSED, _KINEMATIC, _EFFORT_OUTPUTS = (
    "joint_position",
    ("joint_position", "joint_velocity", "joint_acceleration"),
    "joint_effort",
)
Bounds = dict[str, Annotated[tuple[float, float], vector(2)]]


def _is_number(value: Any) -> bool:
    """Return whether a value is a number, one of NumPy's included."""
    return isinstance(value, Real) and not isinstance(value, bool)


def _held_out(value: Any) -> bool | tuple[float, float] | dict[str, Any]:
    if isinstance(value, bool):
        return value
    if isinstance(value, dict):
        for name, cells in value.items():
            listed = cells if isinstance(cells, list | tuple) else [cells]
            if not listed or not all(isinstance(cell, str) or _is_number(cell) for cell in listed):
                raise problem(name, "must be a number or word of that column, or a list of them", cells)
        if not value:
            raise problem("", "must name a column", value)
        return value
    numbers = isinstance(value, list | tuple) and len(value) == 2 and all(map(_is_number, value))
    if not numbers or not 0.0 <= value[0] < value[1] < math.inf:
        raise problem("", "must be true, or the first and the last second of a part, such as [2.0, 3.0]", value)
    return float(value[0]), float(value[1])


# Inputs that may be given by their rate.
_GOALS = ("spool_angle", "tendon_winding")


class Column(Description):
    """A column of a recording: SI value = scale times the number in its unit, plus offset; in a file a name will do."""

    column: str = Field(
        strict=True,
        min_length=1,
        max_length=200,
        description="Its name in the header; a unit in brackets may be left out.",
    )
    unit: str | None = Field(
        None,
        strict=True,
        description="Such as mm, deg, gf; that in brackets in the header, else SI, if it is left out.",
    )
    period: Annotated[float, real(0.0, 1e18, above=True)] | None = quantity(
        None, unit="1", source="the encoder", doc="Where the numbers come round, before unit and scale: unwrapped."
    )
    scale: Annotated[float, real(-1e12, 1e12)] = quantity(
        1.0, unit="1", source="calibration", doc="Factor on what the column has, in SI."
    )
    offset: Annotated[float, real(-1e12, 1e12)] = quantity(0.0, unit="SI", source="calibration", doc="Added, in SI.")
    supply: str | None = Field(
        None,
        strict=True,
        min_length=1,
        max_length=200,
        description="Another column that it is multiplied by: the voltage, V, that a pulse width is a part of.",
    )
    least_noise: Annotated[float, real(0.0, 1e12)] = quantity(
        0.0, unit="SI", source="the sensor", doc="Outputs: the standard deviation that the fit must not go below."
    )
    noise_share: Annotated[float, real(0.0, 1.0)] = quantity(
        0.0, unit="1", source="the sensor", doc="Outputs: part of a reading by which noise grows, beside least_noise."
    )
    noise: str | None = Field(
        None,
        strict=True,
        min_length=1,
        max_length=200,
        description="Outputs: a name for the noise that several of one unit share; each has its own by default.",
    )
    delay: Annotated[float, real(-10.0, 10.0)] = quantity(
        0.0, unit="s", source="calibration", doc="Delay of the column behind its quantity; motions only."
    )
    hold: bool = Field(
        False,
        strict=True,
        description="Inputs of motions: each reading holds until the next, as the goal that a servo was sent.",
    )
    integrate: bool = Field(
        False,
        strict=True,
        description="Inputs spool_angle and tendon_winding of motions: the column is a speed, as a servo in velocity "
        "mode is sent, held from row to row; its integral begins at the motor's position where that is an output.",
    )
    smoothing: Annotated[float, real(0.0, 1e3)] | None = quantity(
        None,
        unit="rad",
        source="the encoder",
        doc="Inputs joint_position of motions: rms by which a smooth curve passes beside the readings; 0: through all.",
    )

    @property
    def signal_kind(self) -> str:
        """The kind of the signal through its readings."""
        return "hold" if self.hold else "samples"

    @model_validator(mode="after")
    def _has_floor(self) -> Self:
        if self.noise_share and not self.least_noise:
            raise problem("noise_share", "needs least_noise, that of a reading of zero", self.noise_share)
        return self

    @model_validator(mode="before")
    @classmethod
    def _named(cls, value: Any) -> Any:
        return {"column": value} if isinstance(value, str) else value


class RecordingSettings(TableFormat):
    """A table of readings or of a motion. Columns are named ``variable.label`` as in a result."""

    file: str | None = Field(None, strict=True, description="A CSV file, relative to the file that names it.")
    rows: dict[str, float | str] = Field(
        {}, description="By column of a file with several recordings, the number or word in the rows of this one."
    )
    kind: Annotated[Literal["motion", "steady"], choice("motion", "steady")] = quantity(
        "motion", unit="1", source="the recording", doc="Samples over time, or rows each of which is a steady state."
    )
    inputs: dict[str, Column] = Field({}, description="Columns that feed the model, by variable.label.")
    outputs: dict[str, Column] = Field(min_length=1, description="Columns that it is compared with, by variable.label.")
    speed: Column | float | None = Field(
        None,
        description="Steady: of sliding, m/s, positive as the tendon is drawn in; a number or a column. Left out, "
        "postures (joint_position) are those without friction.",
    )
    at_rest: bool = Field(False, strict=True, description="Steady: read at rest, after having slid at that speed.")
    time: Column | None = Field(None, description="Motion: the column of times.")
    sample_rate: Annotated[float, real(0.0, 1e9, above=True)] | None = quantity(
        None, unit="Hz", source="the recording", doc="Motion: rows per second, where no column has times."
    )
    start: Annotated[Literal["rest", "recorded", "found"], choice("rest", "recorded", "found")] = quantity(
        "rest",
        unit="1",
        source="the recording",
        doc="Motion: at rest where the scenario starts, at the recorded positions, or at positions to be found.",
    )
    window: Annotated[float, real(0.0, 1e6, above=True)] | None = quantity(
        None, unit="s", source="chosen", doc="Motion: cut into pieces of this length with starts of their own."
    )
    settle: Annotated[float, real(0.0, 1e6)] = quantity(
        0.0, unit="s", source="chosen", doc="Motion: run before what is compared, as bristles begin relaxed."
    )

    values: dict[str, Any] = Field({}, description="By dotted key of the scenario, what holds for this one alone.")
    parameters: Bounds = Field({}, description="As identify.parameters, what is found for this one alone.")

    held_out: Annotated[bool | tuple[float, float] | dict[str, Any], BeforeValidator(_held_out)] = Field(
        False,
        description="Whether it is predicted, not fitted; or its part between two times, s from its start; or by "
        "column the number or word, or a list of them, in such rows.",
    )

    @property
    def imposed(self) -> bool:
        """Whether the motion of the joints is an input, so that nothing of it is computed."""
        return self.kind == "motion" and any(name.partition(".")[0] == IMPOSED for name in self.inputs)

    def _is_motion_input(self, name: str) -> bool:
        return self.kind == "motion" and name.startswith("inputs.")

    @model_validator(mode="after")
    def _imposes(self) -> Self:
        columns = {f"inputs.{name}": each for name, each in self.inputs.items()}
        columns |= {f"outputs.{name}": each for name, each in self.outputs.items()}
        for name, column in {**columns, "time": self.time, "speed": self.speed}.items():
            smooth = self.imposed and name.startswith(f"inputs.{IMPOSED}.")
            if isinstance(column, Column) and column.hold and (smooth or not self._is_motion_input(name)):
                raise problem(f"{name}.hold", f"is for inputs of motions other than {IMPOSED} only", True)
            if isinstance(column, Column) and column.integrate:
                goal = name.removeprefix("inputs.").partition(".")[0] in _GOALS and self._is_motion_input(name)
                if not goal or column.hold:
                    allowed = f"is for inputs {' and '.join(_GOALS)} of motions only, without hold"
                    raise problem(f"{name}.integrate", allowed, True)
            if isinstance(column, Column) and not smooth and column.smoothing is not None:
                raise problem(f"{name}.smoothing", f"is for inputs {IMPOSED} of motions only", column.smoothing)
            if isinstance(column, Column) and smooth and column.smoothing is None:
                allowed = (
                    "is missing: the noise of these readings, rad rms, that a smooth curve leaves out, or 0 for none"
                )
                raise problem(f"{name}.smoothing", allowed)
        for name in self.outputs:
            variable = name.partition(".")[0]
            if self.imposed and variable in _KINEMATIC:
                raise problem(f"outputs.{name}", f"cannot be compared: the inputs {IMPOSED} say it")
            if not self.imposed and variable == _EFFORT_OUTPUTS:
                raise problem(f"outputs.{name}", f"is there where {IMPOSED} of every joint is an input of a motion")
        if self.imposed and self.start != "rest":
            raise problem("start", f"is for motions that are computed: the inputs {IMPOSED} say it", self.start)
        return self

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.held_out is True and self.parameters:
            raise problem("parameters", "are for a recording that is fitted, and this one is held out")
        _check_ordered(self.parameters)
        for name, column in {**{f"inputs.{k}": c for k, c in self.inputs.items()}, "time": self.time}.items():
            for key in ("least_noise", "noise_share", "noise"):
                if column is not None and getattr(column, key):
                    raise problem(f"{name}.{key}", "is for outputs only", getattr(column, key))
        for key, value in self.values.items():
            if isinstance(value, dict):
                raise problem(f"values.{key}", "must be one value, not a table: write its dotted key in quotes")
        for group in ("inputs", "outputs"):
            for name in getattr(self, group):
                if not all(name.partition(".")[::2]):
                    raise problem(f"{group}.{name}", "must be variable.label, such as tendon_tension.T1")
        if self.kind == "steady":
            if self.speed is None and not all(name.startswith("joint_position.") for name in self.outputs):
                raise problem("speed", "is missing: of sliding, m/s, positive where the tendon is drawn in")
            for name in ("time", "sample_rate", "window"):
                if getattr(self, name) is not None:
                    raise problem(name, "is for motions only")
            if self.repeated_times != "refuse":
                raise problem("repeated_times", "is for motions only", self.repeated_times)
            columns: dict[str, Any] = {f"inputs.{k}": c for k, c in self.inputs.items()}
            columns |= {f"outputs.{k}": c for k, c in self.outputs.items()} | {"speed": self.speed}
            for name, column in columns.items():
                if isinstance(column, Column) and column.period is not None:
                    raise problem(f"{name}.period", "is for motions only: rows must follow each other", column.period)
            if isinstance(self.held_out, tuple):
                raise problem("held_out", "must be true or false: only a motion has parts", list(self.held_out))
            if isinstance(self.speed, float) and (not math.isfinite(self.speed) or self.speed == 0.0):
                raise problem("speed", "must be finite and not zero: friction has the sign of sliding", self.speed)
        else:
            if self.time is None and self.sample_rate is None:
                raise problem("time", 'is missing: the column of times, such as time = "t", or sample_rate, Hz')
            if self.sample_rate is not None and (self.time is not None or self.repeated_times != "refuse"):
                key = "time" if self.time is not None else "repeated_times"
                raise problem("sample_rate", f"is for rows without times: leave out this or {key}", self.sample_rate)
            if self.speed is not None or self.at_rest:
                raise problem("speed" if self.speed is not None else "at_rest", "is for steady readings only")
        return self


class IdentifySettings(Description):
    """The table ``[identify]`` of a scenario: the numbers to be found, the recordings, and rival laws."""

    parameters: Bounds = Field({}, description="By dotted key of the scenario, the least and the greatest value.")
    recordings: dict[Name, RecordingSettings] = Field(min_length=1, description="What was recorded, by name.")
    compare: dict[str, dict[str, Any]] = Field(
        {}, description="Other laws, by name: keys with a number that is held, or with bounds."
    )

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """The bounds of all parameters, by key; those of one recording begin with its name."""
        of_recordings = {
            f"{OF_RECORDINGS}{name}.{key}": each
            for name, recording in self.recordings.items()
            for key, each in recording.parameters.items()
        }
        return self.parameters | of_recordings

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        _check_ordered(self.parameters)
        if not self.bounds:
            raise problem("parameters", "is missing: by dotted key of the scenario, the least and the greatest value")
        if all(recording.held_out is True for recording in self.recordings.values()):
            raise problem("recordings", "are all held out: none is left to be fitted")
        for name, recording in self.recordings.items():
            for key in recording.parameters:
                if f"{OF_RECORDINGS}{name}.{key}" in self.parameters:
                    raise problem(f"recordings.{name}.parameters.{key}", "stands in identify.parameters too")
        return self


def _check_ordered(bounds: Bounds) -> None:
    for key, (low, high) in bounds.items():
        if low >= high:
            raise problem(f"parameters.{key}", "the least value must be below the greatest", [low, high])
