"""The robot's camera: pictures of what is ahead, drawn without a screen or a graphics card."""

from __future__ import annotations

import io
from ctypes.util import find_library
from importlib import import_module

import mujoco
import numpy as np
from world import STEP, World

WIDTH, HEIGHT = 320, 240
QUALITY = 80
LIBRARIES = {"osmesa": "OSMesa", "egl": "EGL"}
"""What draws, by the module of MuJoCo that uses it, in this order."""


class CameraError(Exception):
    """Nothing on this machine draws pictures."""


class Camera:
    """Looks at a world at every so many steps, and changes nothing in it."""

    def __init__(self, world: World, rate: float) -> None:
        self.every = max(1, round(1 / (rate * STEP)))
        self.model, self.data = world.model, world.data
        try:
            self.image = import_module("PIL.Image")  # images built before the camera lack it
            self.context = drawing()
            self.context.make_current()
            scale = mujoco.mjtFontScale.mjFONTSCALE_100
            self.renderer = mujoco.MjrContext(self.model, scale)
        except (ImportError, AttributeError, OSError, RuntimeError, mujoco.FatalError) as error:
            raise CameraError(str(error)) from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self.renderer)
        self.scene = mujoco.MjvScene(self.model, maxgeom=10_000)
        self.view = mujoco.MjvCamera()
        self.view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self.view.fixedcamid = self.model.camera("ahead").id

    def picture(self) -> bytes:
        """What it sees now, as JPEG."""
        frame, all_of_it = mujoco.MjrRect(0, 0, WIDTH, HEIGHT), mujoco.mjtCatBit.mjCAT_ALL
        option = mujoco.MjvOption()
        mujoco.mjv_updateScene(
            *(self.model, self.data, option, None, self.view, all_of_it, self.scene)
        )
        mujoco.mjr_render(frame, self.scene, self.renderer)
        pixels = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, frame, self.renderer)
        file = io.BytesIO()
        self.image.fromarray(pixels[::-1]).save(file, "JPEG", quality=QUALITY)
        return file.getvalue()

    def close(self) -> None:
        self.renderer.free()
        self.context.free()


def drawing():
    """A context of OpenGL without a screen."""
    for module, library in LIBRARIES.items():
        if find_library(library):
            return import_module(f"mujoco.{module}").GLContext(WIDTH, HEIGHT)
    raise CameraError("neither OSMesa nor EGL is installed (Debian: apt-get install libosmesa6)")
