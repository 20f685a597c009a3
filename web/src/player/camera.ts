// What part of the world a picture shows.
import type { Ground, Still } from "./drive";

export interface Camera {
  /** What is in the middle [m]. */
  x: number;
  y: number;
  /** Pixels for a metre. */
  scale: number;
}

export interface Size {
  width: number;
  height: number;
}

/** x and y of two opposite corners. */
export type Box = [number, number, number, number];

export function boxOf(points: ArrayLike<number>[]): Box | null {
  if (points.length === 0) return null;
  const box: Box = [Infinity, Infinity, -Infinity, -Infinity];
  for (const point of points) {
    box[0] = Math.min(box[0], point[0]!);
    box[1] = Math.min(box[1], point[1]!);
    box[2] = Math.max(box[2], point[0]!);
    box[3] = Math.max(box[3], point[1]!);
  }
  return box;
}

function corners(ground: Ground): [number, number][] {
  const [width, height] = [ground.columns * ground.resolution, ground.rows * ground.resolution];
  const [cos, sin] = [Math.cos(ground.yaw), Math.sin(ground.yaw)];
  return [[0, 0], [width, 0], [0, height], [width, height]].map(([x, y]) => [
    ground.x + cos * x! - sin * y!,
    ground.y + sin * x! + cos * y!,
  ]);
}

/** Corners of everything that stands still, and of the way as far as it is known. */
export function extent({ ground, planned }: Still, track: { x: number[]; y: number[] }): Box {
  const points = ground
    ? corners(ground)
    : [...planned.path, ...planned.goals, ...planned.obstacles, ...(planned.start ? [planned.start] : [])];
  const way = track.x.map((x, i) => [x, track.y[i]!]);
  return boxOf([...points, ...way]) ?? [-5, -5, 5, 5];
}

/** What holds all walls: what lies around them would only make a small map smaller. */
export function wallsOf(ground: Ground): Box | null {
  if (ground.yaw !== 0) return null;
  const found: [number, number][] = [];
  let at = 0;
  for (let run = 0; run < ground.runs.length; run += 2) {
    const end = at + ground.runs[run]!;
    if (ground.runs[run + 1] === 2) {
      for (const cell of [at, end - 1]) {
        const [column, row] = [cell % ground.columns, Math.floor(cell / ground.columns)];
        found.push([ground.x + (column + 0.5) * ground.resolution, ground.y + (row + 0.5) * ground.resolution]);
      }
    }
    at = end;
  }
  return boxOf(found);
}

export function fitting([left, low, right, high]: Box, size: Size): Camera {
  const [width, height] = [Math.max(right - left, 1), Math.max(high - low, 1)];
  return {
    x: (left + right) / 2,
    y: (low + high) / 2,
    scale: 0.95 * Math.min(size.width / width, size.height / height),
  };
}

/** The camera after zooming so that a point of the picture stays where it is. */
export function zoomed(camera: Camera, factor: number, size: Size, at = { x: size.width / 2, y: size.height / 2 }): Camera {
  const scale = Math.min(Math.max(camera.scale * factor, 0.5), 5000);
  const change = 1 / camera.scale - 1 / scale;
  return {
    x: camera.x + (at.x - size.width / 2) * change,
    y: camera.y - (at.y - size.height / 2) * change,
    scale,
  };
}

export function moved(camera: Camera, dx: number, dy: number): Camera {
  return { ...camera, x: camera.x - dx / camera.scale, y: camera.y + dy / camera.scale };
}
