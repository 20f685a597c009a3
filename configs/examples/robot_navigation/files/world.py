"""The physics (MuJoCo): a building, boxes that can be pushed, a robot with a laser scanner.

The robot stands on two wheels with limited torque and, when it brakes or speeds up, on a caster.
All noise comes from one generator, so a seed is a drive.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import mujoco
import numpy as np
from grid import Grid

STEP = 0.1
"""Time between two commands [s]."""
RAYS = 120
RANGE = 5.0
"""Of the laser [m]."""
NOISE = 0.01
"""Standard deviation of a range [m]."""
LOST = 0.01
"""Share of rays that do not come back."""
PLACED = (0.02, 0.02, 0.03)
"""Standard deviation of where the robot is put down [m, m, rad]."""
WHEEL = 0.06
"""Radius of a wheel [m]."""
ANGLES = np.linspace(-math.pi, math.pi, RAYS, endpoint=False)
LEVEL = np.column_stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros(RAYS)])
"""Directions of the rays, as the robot sees them."""

Place = tuple[float, float, float]
"""x, y, yaw [m, rad]."""
Box = tuple[Place, float, float]
"""Where it stands, its length and its width [m]."""


class World:
    """Moves by one step for each command."""

    def __init__(
        self,
        grid: Grid,
        boxes: list[Box],
        start: Place,
        radius: float,
        seed: int,
        second: tuple[float, float] | None = None,
    ) -> None:
        self.chance = np.random.default_rng(seed)
        placed = self.put_down(grid, start, radius)
        self.track = 2 * 0.75 * radius
        body, motors = ("", "") if second is None else (cart(*second), CART_MOTORS)
        self.model = mujoco.MjModel.from_xml_string(
            scene(grid, [*map(box, boxes), body], motors, placed, radius, self.track)
        )
        self.data = mujoco.MjData(self.model)
        self.robot, self.laser = self.model.body("robot").id, self.model.site("laser").id
        self.ticks = round(STEP / self.model.opt.timestep)
        self.push = 0.0
        mujoco.mj_forward(self.model, self.data)

    def put_down(self, grid: Grid, start: Place, radius: float) -> Place:
        """Return a random place near the start where a disc of the radius [m] touches no wall.

        Raises:
            ValueError: there is no such place.
        """
        for _ in range(1000):
            x, y, yaw = np.add(start, self.chance.normal(0.0, PLACED))
            if grid.clearance(x, y) >= radius:
                return x, y, yaw
        raise ValueError(f"a robot with a radius of {radius} m touches a wall at the start {start}")

    def move(self, speed: float, turn: float, second: tuple[float, ...] = ()) -> None:
        """Drive for one step [m/s, rad/s]; `push` is the strongest force on the hull in it [N].

        Args:
            speed: of the robot.
            turn: of the robot.
            second: velocity of the second robot, if there is one.
        """
        sides = np.array([1, -1]) * self.track / 2
        self.data.ctrl[:] = (*((speed + turn * sides) / WHEEL), *second)
        self.push = 0.0
        for _ in range(self.ticks):
            mujoco.mj_step(self.model, self.data)
            self.push = max(self.push, self.data.sensordata[0])

    def place(self) -> Place:
        x, y, _ = self.data.xpos[self.robot]
        ahead = self.data.xmat[self.robot]
        return float(x), float(y), math.atan2(ahead[3], ahead[0])

    def second_place(self) -> tuple[float, float]:
        x, y, _ = self.data.body("second").xpos
        return float(x), float(y)

    def speeds(self) -> tuple[float, float]:
        """Of the robot, ahead and turning [m/s, rad/s]."""
        velocity = np.zeros(6)
        kind = mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectVelocity(self.model, self.data, kind, self.robot, velocity, 1)
        return float(velocity[3]), float(velocity[2])

    def ranges(self) -> np.ndarray:
        """What the laser measures [m]; infinity where nothing comes back."""
        rays = LEVEL @ self.data.xmat[self.robot].reshape(3, 3).T
        hit, found = np.empty(RAYS, np.int32), np.empty(RAYS)
        eye = self.data.site_xpos[self.laser]
        mujoco.mj_multiRay(
            *(self.model, self.data, eye, rays.ravel(), SEEN, True, self.robot),
            *(hit, found, None, RAYS, RANGE),
        )
        measured = found + self.chance.normal(0.0, NOISE, RAYS)
        back = (found >= 0) & (measured < RANGE) & (self.chance.random(RAYS) >= LOST)
        return np.where(back, measured, np.inf)


SEEN = np.array([1, 0, 0, 0, 0, 0], np.uint8)
"""Groups of geoms that the laser sees: all but the robot's."""


def scene(
    grid: Grid, others: list[str], motors: str, start: Place, radius: float, track: float
) -> str:
    """The model in MuJoCo's language. Walls are boxes, because it takes a mesh's convex hull."""
    x, y, yaw = start
    return f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast" cone="elliptic"/>
  {LOOKS}
  <worldbody>
    <geom type="plane" size="0 0 1" friction="0.01" material="floor"/>
    {"".join(walls(grid))}
    {"".join(others)}
    <body name="robot" pos="{x} {y} {WHEEL}" euler="0 0 {yaw}">
      <freejoint/>
      <geom type="cylinder" size="{radius} 0.06" pos="0 0 0.04" mass="8" friction="0.3" group="1"/>
      <site name="bumper" type="cylinder" size="{radius + 0.02} 0.08" pos="0 0 0.04"/>
      <site name="laser" pos="0 0 0.12"/>
      <camera name="ahead" pos="0 0 0.25" xyaxes="0 -1 0 0.2 0 1" fovy="65"/>
      {caster(0.7 * radius)}{caster(-0.7 * radius)}
      {wheel("right", -track / 2)}{wheel("left", track / 2)}
    </body>
  </worldbody>
  <actuator>
    <velocity joint="right" kv="0.5" forcerange="-0.6 0.6"/>
    <velocity joint="left" kv="0.5" forcerange="-0.6 0.6"/>
    {motors}
  </actuator>
  <sensor><touch site="bumper"/></sensor>
</mujoco>"""


def wheel(name: str, y: float) -> str:
    return f"""<body name="{name}" pos="0 {y} 0">
      <joint name="{name}" type="hinge" axis="0 1 0" armature="0.001"/>
      <geom type="ellipsoid" size="{WHEEL} 0.02 {WHEEL}" mass="0.5" friction="0.9" group="1"/>
    </body>"""


def caster(x: float) -> str:
    """It is 2 mm above the floor: one that always touched would take the load off the wheels."""
    return f"""<geom type="sphere" size="0.02" pos="{x} 0 {0.022 - WHEEL}" mass="0.1"
      friction="0.02" group="1"/>"""


def walls(grid: Grid) -> Iterator[str]:
    half = grid.resolution / 2
    for top, left, bottom, right in grid.rectangles():
        (x0, y0), (x1, y1) = grid.place(top, left), grid.place(bottom, right)
        yield (
            f'<geom type="box" pos="{(x0 + x1) / 2} {(y0 + y1) / 2} 0.5"'
            f' size="{(x1 - x0) / 2 + half} {(y1 - y0) / 2 + half} 0.5" rgba="0.8 0.82 0.85 1"/>'
        )


def box(given: Box) -> str:
    (x, y, yaw), length, width = given
    return f"""<body pos="{x} {y} 0.2" euler="0 0 {yaw}"><freejoint/>
      <geom type="box" size="{length / 2} {width / 2} 0.2" mass="2" friction="0.5"
      rgba="0.85 0.55 0.2 1"/></body>"""


def cart(x: float, y: float) -> str:
    """The second robot: it floats above the floor, and its motors move it any way."""
    return f"""<body name="second" pos="{x} {y} 0.22">
      <joint name="second_x" type="slide" axis="1 0 0"/>
      <joint name="second_y" type="slide" axis="0 1 0"/>
      <geom type="cylinder" size="0.2 0.2" mass="20" friction="0.5" rgba="0.2 0.4 0.8 1"/></body>"""


CART_MOTORS = """<velocity joint="second_x" kv="200" forcerange="-150 150"/>
    <velocity joint="second_y" kv="200" forcerange="-150 150"/>"""

LOOKS = """<visual>
    <headlight ambient="0.5 0.5 0.5"/>
    <map znear="0.005"/>
    <quality shadowsize="0" offsamples="0"/>
  </visual>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1="0.9 0.95 1" rgb2="0.6 0.7 0.8" width="64"
      height="384"/>
    <texture name="tiles" type="2d" builtin="checker" rgb1="0.75 0.77 0.8" rgb2="0.6 0.62 0.65"
      width="64" height="64"/>
    <material name="floor" texture="tiles" texrepeat="1 1" texuniform="true"/>
  </asset>"""
"""What only the camera sees. Shadows would take longer to draw than all else."""
