"""Writes the images of a topic to a WebM video."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from robovast.analysis.bags.job import Context, nothing_on
from robovast.analysis.bags.source import Consumer, Topic
from robovast.analysis.bags.topics import topic_file
from robovast.base.atomic import part_name, put_in_place
from robovast.base.optional_deps import VIDEO
from robovast.base.safe_paths import create_file
from robovast.model.document.commands import ImagesToWebm

if TYPE_CHECKING:
    from av import VideoCodecContext, VideoFrame

COMPRESSED = "sensor_msgs/msg/CompressedImage"
RAW = "sensor_msgs/msg/Image"

_MAGIC = {b"\xff\xd8": "mjpeg", b"\x89P": "png", b"RI": "webp"}
"""First bytes of each image format, and its decoder."""
_ENCODINGS = {
    "rgb8": ("rgb24", 3),
    "8UC3": ("bgr24", 3),
    "bgr8": ("bgr24", 3),
    "rgba8": ("rgba", 4),
    "bgra8": ("bgra", 4),
    "mono8": ("gray", 1),
    "8UC1": ("gray", 1),
}
"""Pixel format and bytes per pixel of each encoding of raw images."""
_OPTIONS = {"deadline": "realtime", "cpu-used": "8", "crf": "32", "b": "0", "lag-in-frames": "0"}
_SMALLEST, _LARGEST = 2, 4096
"""Width and height of images [pixels]: chroma has half the resolution, and the encoder of a larger
video takes gigabytes."""
_JITTER = 500
"""Difference up to which an image may be earlier than a previous one in the same episode [ms]."""
_MILLISECONDS = Fraction(1, 1000)


class VideoWorker:
    """Writes compressed or raw images as VP9 video; each frame is shown at its stamp."""

    def __init__(self, context: Context, job: ImagesToWebm) -> None:
        VIDEO.require(job.command)
        self._context = context
        self._topic = job.topic
        path = context.folder / f"{topic_file(context, job.topic)}.webm"
        self._video = _Video(path, job.fps)

    def subscribe(self, topic: Topic) -> Consumer | None:
        """The consumer of the topic's images, or None."""
        if topic.name != self._topic:
            return None
        frames: dict[str, Callable[[Any], VideoFrame]] = {COMPRESSED: _decoded, RAW: _raw}
        if topic.type not in frames:
            self._context.warn(f"{topic.name} has no images but {topic.type}")
            return None
        read, frame = self._context.reader(topic), frames[topic.type]

        def consume(time: int, data: bytes) -> None:
            image: Any = read(data)
            stamp = image.header.stamp.sec * 1_000_000_000 + image.header.stamp.nanosec
            self._video.add(_bounded(frame(image)), stamp or time)

        return consume

    def finish(self) -> list[Path]:
        """The video; empty if there are no images."""
        if self._video.close():
            return [self._video.path]
        self._context.warn(nothing_on(self._context, self._topic))
        return []

    def discard(self) -> None:
        """Remove unfinished files."""
        self._video.discard()


def _bounded(frame: VideoFrame) -> VideoFrame:
    if not all(_SMALLEST <= length <= _LARGEST for length in (frame.width, frame.height)):
        raise ValueError(
            f"an image has {frame.width} x {frame.height} pixels; videos have {_SMALLEST} to "
            f"{_LARGEST} in each direction"
        )
    return frame


def _decoded(image: Any) -> VideoFrame:
    import av

    data = image.data.tobytes()
    name = _MAGIC.get(data[:2])
    if name is None:
        raise ValueError(f"images in the format {image.format!r} are not supported")
    # A decoder uses previous images as references, so each image needs a new one.
    decoder = cast("VideoCodecContext", av.CodecContext.create(name, "r"))
    try:
        frames = decoder.decode(av.Packet(data))
    except av.error.FFmpegError as error:
        raise ValueError(f"a damaged image: {error}") from error
    if not frames:
        raise ValueError("an incomplete image")
    return frames[0]


def _raw(image: Any) -> VideoFrame:
    from av import VideoFrame

    if image.encoding not in _ENCODINGS:
        raise ValueError(f"images in the encoding {image.encoding!r} are not supported")
    name, channels = _ENCODINGS[image.encoding]
    rows = image.data.reshape(image.height, image.step)[:, : image.width * channels]
    shape = (image.height, image.width, channels) if channels > 1 else rows.shape
    return VideoFrame.from_ndarray(np.ascontiguousarray(rows).reshape(shape), format=name)


class _Video:
    """A WebM file; the first frame determines its size."""

    def __init__(self, path: Path, fps: float) -> None:
        self.path = path
        self._part = part_name(path)
        self._fps = fps
        self._container: Any = None
        self._stream: Any = None
        self._start = 0
        self._last = -1

    def add(self, frame: VideoFrame, time: int) -> None:
        """Append a frame; if the time [ns] does not advance, the nominal frame rate is used.

        After a jump back in time, the video continues with the times of the new episode.
        """
        if self._container is None:
            self._open(frame, time)
        moment = (time - self._start) // 1_000_000
        if moment <= self._last:
            lost, moment = self._last - moment, self._last + max(1, round(1000 / self._fps))
            if lost > _JITTER:
                self._start = time - moment * 1_000_000
        self._last = moment
        frame = frame.reformat(self._stream.width, self._stream.height, "yuv420p")
        frame.pts, frame.time_base = moment, _MILLISECONDS
        self._container.mux(self._stream.encode(frame))

    def close(self) -> bool:
        """Complete the file; return False if there was no frame."""
        if self._container is None:
            return False
        self._container.mux(self._stream.encode(None))
        self._container.close()
        put_in_place(self._part, self.path, lasting=False)
        return True

    def discard(self) -> None:
        """Remove unfinished files."""
        if self._container is not None:
            self._container.close()
        self._part.unlink(missing_ok=True)

    def _open(self, frame: VideoFrame, time: int) -> None:
        import av

        create_file(self._part).close()  # never write through an existing link
        self._container = av.open(str(self._part), "w", format="webm")
        rate = Fraction(self._fps).limit_denominator(1000)
        self._stream = self._container.add_stream("libvpx-vp9", rate=rate, options=_OPTIONS)
        self._stream.width, self._stream.height = frame.width & -2, frame.height & -2
        self._stream.pix_fmt = "yuv420p"
        self._stream.codec_context.time_base = _MILLISECONDS
        self._start = time
