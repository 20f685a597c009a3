"""What the built-in postprocessing commands take, known without what executes them.

So a document can be checked where no results are, and no extra is installed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, field_validator
from pydantic_core import PydanticCustomError

from robovast.base.errors import InputError
from robovast.model.document.model import PluginCall
from robovast.model.variation_config import get_validated_config

ModelT = TypeVar("ModelT", bound=BaseModel)

GROUP = "robovast.postprocessing_commands"
"""Entry points of commands."""
ROSOUT = "rosbags_rosout_to_csv"
PROCESS = "rosbags_process"
"""The command that holds several of those for bags."""
LEVELS = {"DEBUG": 10, "INFO": 20, "WARN": 30, "ERROR": 40, "FATAL": 50}
"""Of log messages."""
JOB_LOGS = "logs/rosout_bag"
"""Where the entrypoint records what all runs of a job logged, in the job's folder."""


def _plain_name(name: str) -> str:
    if not name or "/" in name or name in {".", ".."}:
        raise PydanticCustomError(
            "file_name", "must be a file name without a folder: files go beside the bag"
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


class BagCommand(BaseModel):
    """A command that reads ROS bags, with its parameters; unknown ones have no effect."""

    model_config = ConfigDict(frozen=True, extra="ignore")
    command: ClassVar[str]
    bag_dir: BagPath = "rosbag2"
    """How the path of a bag's folder ends."""


class TopicsToCsv(BagCommand):
    """Each topic as `<bag>_<topic>.csv`."""

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
    """Pose [m, rad] of each frame in `map`, whenever the bag received one [s]."""

    command = "rosbags_tf_to_csv"
    frames: tuple[str, ...] = Field(default=("base_link",), min_length=1)
    csv_filename: FileName = "poses.csv"


class BehaviorsToCsv(BagCommand):
    """A row whenever a behaviour's status has changed; the time [s] is that of receipt."""

    command = "rosbags_bt_to_csv"
    csv_filename: FileName = "behaviors.csv"


class ActionToCsv(BagCommand):
    """Every message on an action's feedback and status topics, with the time of receipt [s]."""

    command = "rosbags_action_to_csv"
    action: str = Field(min_length=1)
    filename_prefix: FileName | None = None


class RosoutToCsv(BagCommand):
    """Every log message of a level, with the times [s] of receipt and of its own stamp."""

    command = ROSOUT
    min_level: Annotated[int, BeforeValidator(_level), Field(ge=0)] = 10
    skip_levels: tuple[LevelName, ...] = ()
    csv_filename: FileName = "rosout.csv"
    bag_dir: BagPath = JOB_LOGS


class ImagesToWebm(BagCommand):
    """A topic of compressed or raw images as VP9 video, each frame at the time of its stamp."""

    command = "rosbags_to_webm"
    topic: str = Field(default="/camera/image_raw/compressed", min_length=1)
    fps: float = Field(default=30, gt=0)


BAG_COMMANDS: dict[str, type[BagCommand]] = {
    kind.command: kind
    for kind in (TopicsToCsv, TfToCsv, BehaviorsToCsv, ActionToCsv, RosoutToCsv, ImagesToWebm)
}
"""By name; one pass over a bag does all."""


class _Part(BaseModel):
    """One of the commands in `rosbags_process`; what else is in it are its parameters."""

    model_config = ConfigDict(extra="allow")
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
    """Several commands for bags under one name."""

    model_config = ConfigDict(extra="ignore")
    plugins: list[_Part] = Field(default_factory=list)
    workers: int | None = None
    bag_dir: BagPath | None = None


class Command(BaseModel):
    """A program."""

    model_config = ConfigDict(extra="ignore")
    script: str = Field(min_length=1)
    args: list[Any] = Field(default_factory=list)


class Compress(BaseModel):
    """An archive."""

    model_config = ConfigDict(extra="ignore")
    output_dir: str | None = None
    exclude_dirs: list[str] = Field(default_factory=lambda: [".cache"])
    overwrite: bool = False


BUILT_IN: dict[str, type[BaseModel]] = {
    **BAG_COMMANDS,
    PROCESS: Process,
    "command": Command,
    "compress": Compress,
}
"""Models of parameters by command."""


def flat(topic: str) -> str:
    """A topic in the name of a file."""
    return topic.strip("/").replace("/", "_")


def bag_command(name: str, parameters: Mapping[str, Any]) -> BagCommand:
    """A command for bags as a .vast file calls it.

    Raises:
        InputError: a parameter is missing, misspelt or wrong.
    """
    return _validated(name, BAG_COMMANDS[name], parameters)


def _validated(name: str, model: type[ModelT], parameters: Mapping[str, Any]) -> ModelT:
    try:
        return get_validated_config(dict(parameters), model)
    except ValueError as error:
        known = ", ".join(model.model_fields)
        raise InputError(f"{name}: {error}. Its parameters: {known}.") from None


def expanded(calls: Iterable[PluginCall]) -> list[PluginCall]:
    """The calls with those that `rosbags_process` holds in its place.

    Raises:
        InputError: it holds something else.
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
