"""Parameters of the built-in postprocessing commands, apart from the code that executes them.

A document can therefore be checked without results and without optional dependencies.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, field_validator
from pydantic_core import PydanticCustomError

from robovast.base.errors import InputError
from robovast.model.document.section import PluginCall
from robovast.model.strict_numbers import StrictNumbers
from robovast.model.variation_config import get_validated_config

ModelT = TypeVar("ModelT", bound=BaseModel)

GROUP = "robovast.postprocessing_commands"
"""Commands that have an entry point of their own."""
ROSOUT = "rosbags_rosout_to_csv"
PROCESS = "rosbags_process"
"""The command that contains several bag commands."""
LEVELS = {"DEBUG": 10, "INFO": 20, "WARN": 30, "ERROR": 40, "FATAL": 50}
"""Levels of log messages."""
JOB_LOGS = "logs/rosout_bag"
"""Folder, within a job's folder, where the entrypoint records the log messages of all its runs."""


def _plain_name(name: str) -> str:
    if not name or "/" in name or name in {".", ".."}:
        raise PydanticCustomError(
            "file_name", "must be a file name without a folder: files are written next to the bag"
        )
    return name


def _bag_path(path: str) -> str:
    parts = path.strip("/").split("/")
    if path.startswith("/") or not set(parts).isdisjoint({"", ".", ".."}):
        raise PydanticCustomError("bag_dir", "must be the path of a folder below a run or a job")
    return "/".join(parts)


def _level(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    if value.upper() not in LEVELS:
        known = ", ".join(LEVELS)
        raise PydanticCustomError("level", "must be one of {known}", {"known": known})
    return LEVELS[value.upper()]


FileName = Annotated[str, AfterValidator(_plain_name)]
BagPath = Annotated[str, AfterValidator(_bag_path)]
LevelName = Annotated[
    Literal["DEBUG", "INFO", "WARN", "ERROR", "FATAL"],
    BeforeValidator(lambda name: name.upper() if isinstance(name, str) else name),
]


class BagCommand(StrictNumbers):
    """A command that reads ROS bags, with its parameters; unknown parameters have no effect."""

    model_config = ConfigDict(frozen=True, extra="ignore", defer_build=True)
    command: ClassVar[str]
    bag_dir: BagPath = "rosbag2"
    """Path suffix of the bag's folder."""


class TopicsToCsv(BagCommand):
    """Writes each topic to `<bag>_<topic>.csv`."""

    command = "rosbags_to_csv"
    topics: tuple[str, ...] = ()

    @field_validator("topics")
    @classmethod
    def _one_file_each(cls, topics: tuple[str, ...]) -> tuple[str, ...]:
        files: dict[str, str] = {}
        for topic in topics:
            other = files.setdefault(flat(topic), topic)
            if other != topic:
                raise PydanticCustomError(
                    "topics",
                    "{other} and {topic} would be written to one file",
                    {"other": other, "topic": topic},
                )
        return topics


class TfToCsv(BagCommand):
    """Writes poses [m, rad] of frames in a root frame whenever the bag received one [s]."""

    command = "rosbags_tf_to_csv"
    frames: tuple[str, ...] = Field(default=("base_link",), min_length=1)
    csv_filename: FileName = "poses.csv"
    root_frame: str = Field(default="map", min_length=1)
    """The frame that poses are given in."""
    tf_topic: str = Field(default="/tf", min_length=1)
    """Topic of the transforms; fixed transforms are on `<tf_topic>_static`."""


class BehaviorsToCsv(BagCommand):
    """Writes a row whenever a behaviour's status changes; the time [s] is the time of receipt."""

    command = "rosbags_bt_to_csv"
    csv_filename: FileName = "behaviors.csv"


class ActionToCsv(BagCommand):
    """Writes all messages on an action's feedback and status topics, with time of receipt [s]."""

    command = "rosbags_action_to_csv"
    action: str = Field(min_length=1)
    filename_prefix: FileName | None = None


class RosoutToCsv(BagCommand):
    """Writes log messages of a level, with time of receipt and time of their stamp [s]."""

    command = ROSOUT
    min_level: Annotated[int, BeforeValidator(_level), Field(ge=0)] = 10
    skip_levels: tuple[LevelName, ...] = ()
    csv_filename: FileName = "rosout.csv"
    bag_dir: BagPath = JOB_LOGS


class ImagesToWebm(BagCommand):
    """Writes a topic of compressed or raw images as VP9 video; frames are shown at their stamps."""

    command = "rosbags_to_webm"
    topic: str = Field(default="/camera/image_raw/compressed", min_length=1)
    fps: float = Field(default=30, gt=0)


BAG_COMMANDS: dict[str, type[BagCommand]] = {
    kind.command: kind
    for kind in (TopicsToCsv, TfToCsv, BehaviorsToCsv, ActionToCsv, RosoutToCsv, ImagesToWebm)
}
"""Bag commands by name; a single pass over a bag serves them all."""


class _Part(BaseModel):
    """One command in `rosbags_process`; its other keys are the command's parameters."""

    model_config = ConfigDict(extra="allow", defer_build=True)
    type: str

    @field_validator("type")
    @classmethod
    def _known(cls, name: str) -> str:
        known = [command.removeprefix("rosbags_") for command in BAG_COMMANDS]
        if name not in known:
            raise PydanticCustomError(
                "bag_type", "must be one of {known}", {"known": ", ".join(known)}
            )
        return name


class Process(BaseModel):
    """Several bag commands in one call."""

    model_config = ConfigDict(extra="ignore", defer_build=True)
    plugins: list[_Part] = Field(default_factory=list)
    workers: int | None = None
    bag_dir: BagPath | None = None


class Command(BaseModel):
    """A program."""

    model_config = ConfigDict(extra="ignore", defer_build=True)
    script: str = Field(min_length=1)
    args: list[Any] = Field(default_factory=list)


class Compress(BaseModel):
    """An archive."""

    model_config = ConfigDict(extra="ignore", defer_build=True)
    output_dir: str | None = None
    exclude_dirs: list[str] = Field(default_factory=lambda: [".cache"])
    overwrite: bool = False


BUILT_IN: dict[str, type[BaseModel]] = {
    **BAG_COMMANDS,
    PROCESS: Process,
    "command": Command,
    "compress": Compress,
}
"""Parameter models by command name."""


def flat(topic: str) -> str:
    """A topic's name as part of a file name."""
    return topic.strip("/").replace("/", "_")


def bag_command(name: str, parameters: Mapping[str, Any]) -> BagCommand:
    """Validate a .vast file's call of a bag command.

    Raises:
        InputError: a parameter is missing, misspelt or wrong.
    """
    return _validated(name, BAG_COMMANDS[name], parameters)


def _validated(name: str, model: type[ModelT], parameters: Mapping[str, Any]) -> ModelT:
    try:
        return get_validated_config(dict(parameters), model)
    except ValueError as error:
        known = ", ".join(model.model_fields)
        raise InputError(f"{name}: {error}", hint=f"use its parameters: {known}") from None


def expanded(calls: Iterable[PluginCall]) -> list[PluginCall]:
    """The calls, with each `rosbags_process` replaced by the commands that it contains.

    Raises:
        InputError: `rosbags_process` contains anything but bag commands.
    """
    return [part for call in calls for part in _parts(call)]


def _parts(call: PluginCall) -> Iterator[PluginCall]:
    if call.name != PROCESS:
        yield call
        return
    process = _validated(PROCESS, Process, call.parameters)
    shared = {} if process.bag_dir is None else {"bag_dir": process.bag_dir}
    for part in process.plugins:
        parameters = {**shared, **(part.model_extra or {})}
        yield PluginCall(name=f"rosbags_{part.type}", parameters=parameters)
