// Draws drives on their map.
import type { Verdict } from "../api";
import { PLAYER } from "../text";
import type { Camera, Size } from "./camera";
import { GAP, lastUpTo, poseAt, type Drive, type Ground, type Still, type Point, type Pose, type Track } from "./drive";

/** Points of a way that are drawn at once. */
const STRETCH = 256;
const CLOSE = 0.02;
const USUAL_DIAMETER = 0.4;

export interface Colours {
  ground: string;
  wall: string;
  unknown: string;
  text: string;
  quiet: string;
  plan: string;
  scan: string;
  obstacle: string;
  goal: string;
  drives: string[];
  verdicts: Record<Verdict, string>;
}

export function coloursOf(element: Element): Colours {
  const style = getComputedStyle(element);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  return {
    ground: colour("--ground"),
    wall: colour("--wall"),
    unknown: colour("--unknown"),
    text: colour("--text"),
    quiet: colour("--quiet"),
    plan: colour("--curve-3"),
    scan: colour("--curve-2"),
    obstacle: colour("--curve-5"),
    goal: colour("--passed"),
    drives: [colour("--curve-1"), colour("--curve-4")],
    verdicts: {
      passed: colour("--passed"),
      failed: colour("--failed"),
      errored: colour("--errored"),
      interrupted: colour("--interrupted"),
    },
  };
}

/** A map as a picture, one pixel for a cell, its lowest row first. */
export function pictureOf(ground: Ground, colours: Pick<Colours, "wall" | "unknown">): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = ground.columns;
  canvas.height = ground.rows;
  const context = canvas.getContext("2d", { willReadFrequently: true })!;
  const image = context.createImageData(ground.columns, ground.rows);
  const cells = new Uint32Array(image.data.buffer);
  const kinds = [0, packed(context, colours.unknown), packed(context, colours.wall)];
  let at = 0;
  for (let run = 0; run < ground.runs.length; run += 2) {
    const end = at + ground.runs[run]!;
    cells.fill(kinds[ground.runs[run + 1]!] ?? 0, at, end);
    at = end;
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

/** A colour as it lies in the memory of a picture. */
function packed(context: CanvasRenderingContext2D, colour: string): number {
  context.fillStyle = colour;
  context.fillRect(0, 0, 1, 1);
  return new Uint32Array(context.getImageData(0, 0, 1, 1).data.buffer)[0]!;
}

/** Let what is drawn be in metres, y upwards. */
export function inMetres(context: CanvasRenderingContext2D, camera: Camera, size: Size, pixels: number): void {
  const scale = camera.scale * pixels;
  const x = (size.width / 2) * pixels - camera.x * scale;
  const y = (size.height / 2) * pixels + camera.y * scale;
  context.setTransform(scale, 0, 0, -scale, x, y);
}

function trace(points: Point[]): Path2D {
  const path = new Path2D();
  points.forEach(([x, y], i) => (i ? path.lineTo(x, y) : path.moveTo(x, y)));
  return path;
}

/** The way of a robot, cut into stretches, so that the way up to any moment is drawn quickly. */
export class Way {
  private readonly ends: number[] = [];
  private readonly stretches: Path2D[] = [];

  constructor(private readonly track: Track) {
    const { times } = track;
    for (let begin = 0; begin < times.length - 1; begin += STRETCH) {
      const end = Math.min(begin + STRETCH, times.length - 1);
      this.stretches.push(this.stretch(begin, end));
      this.ends.push(times[end]!);
    }
  }

  draw(context: CanvasRenderingContext2D, time: number): void {
    const whole = lastUpTo(this.ends, time) + 1;
    for (const stretch of this.stretches.slice(0, whole)) context.stroke(stretch);
    const last = lastUpTo(this.track.times, time);
    const begin = whole * STRETCH;
    if (last < begin) return;
    const rest = this.stretch(begin, last);
    const now = poseAt(this.track, time);
    if (now && !now.age) rest.lineTo(now.x, now.y);
    context.stroke(rest);
  }

  private stretch(begin: number, end: number): Path2D {
    const { times, x, y } = this.track;
    const path = new Path2D();
    path.moveTo(x[begin]!, y[begin]!);
    let from = begin;
    for (let i = begin + 1; i <= end; i++) {
      if (times[i]! - times[i - 1]! > GAP) {
        path.moveTo(x[i]!, y[i]!);
        from = i;
      } else if (i === end || Math.hypot(x[i]! - x[from]!, y[i]! - y[from]!) > CLOSE) {
        path.lineTo(x[i]!, y[i]!);
        from = i;
      }
    }
    return path;
  }
}

/** What stands still: map, obstacles, start and goals. */
export function drawStill(
  context: CanvasRenderingContext2D,
  { ground, planned }: Still,
  picture: HTMLCanvasElement | null,
  camera: Camera,
  colours: Colours,
): void {
  if (ground && picture) {
    context.save();
    context.translate(ground.x, ground.y);
    context.rotate(ground.yaw);
    context.imageSmoothingEnabled = false;
    context.drawImage(picture, 0, 0, ground.columns * ground.resolution, ground.rows * ground.resolution);
    context.restore();
  }
  context.fillStyle = colours.obstacle;
  for (const obstacle of planned.obstacles) drawObstacle(context, obstacle);
  context.lineWidth = 1.5 / camera.scale;
  context.strokeStyle = colours.quiet;
  context.setLineDash([4 / camera.scale, 4 / camera.scale]);
  context.stroke(trace(planned.path));
  context.setLineDash([]);
  const radius = Math.max((planned.diameter ?? USUAL_DIAMETER) / 2, 7 / camera.scale);
  planned.goals.forEach(([x, y], i) => drawSign(context, x!, y!, radius, String(i + 1), colours.goal, colours.ground));
  if (planned.start) {
    drawSign(context, planned.start[0]!, planned.start[1]!, radius, "S", colours.quiet, colours.ground);
  }
}

/** The whole ways of other runs, and where each ended. */
export function drawOthers(context: CanvasRenderingContext2D, others: Drive[], camera: Camera, colours: Colours): void {
  for (const { answer, track } of others) {
    const verdict = answer.verdict ?? "interrupted";
    const last = track.times.length - 1;
    if (last < 0) continue;
    context.strokeStyle = colours.verdicts[verdict];
    context.lineWidth = 1.2 / camera.scale;
    new Way(track).draw(context, Infinity);
    drawEnd(context, track.x[last]!, track.y[last]!, verdict, camera, colours);
  }
}

/** The way of a run, under which others can be seen. */
export function drawThinWay(context: CanvasRenderingContext2D, way: Point[], verdict: Verdict, camera: Camera, colours: Colours): void {
  context.strokeStyle = colours.verdicts[verdict];
  context.lineWidth = 1.5 / camera.scale;
  context.globalAlpha = 0.7;
  context.stroke(trace(way));
  context.globalAlpha = 1;
}

/** Where a run ended: a cross if it did not pass. */
export function drawEnd(
  context: CanvasRenderingContext2D,
  x: number,
  y: number,
  verdict: Verdict,
  camera: Camera,
  colours: Colours,
): void {
  const size = 5 / camera.scale;
  context.strokeStyle = context.fillStyle = colours.verdicts[verdict];
  context.lineWidth = 3 / camera.scale;
  context.beginPath();
  if (verdict === "passed") {
    context.arc(x, y, size * 0.8, 0, 2 * Math.PI);
    context.fill();
  } else {
    context.moveTo(x - size, y - size);
    context.lineTo(x + size, y + size);
    context.moveTo(x - size, y + size);
    context.lineTo(x + size, y - size);
    context.stroke();
  }
}

function drawObstacle(context: CanvasRenderingContext2D, [x, y, third, length, width]: number[]): void {
  context.save();
  context.translate(x!, y!);
  context.beginPath();
  if (length !== undefined && width !== undefined) {
    context.rotate(third!);
    context.rect(-length / 2, -width / 2, length, width);
  } else {
    context.arc(0, 0, third!, 0, 2 * Math.PI);
  }
  context.fill();
  context.restore();
}

function drawSign(
  context: CanvasRenderingContext2D,
  x: number,
  y: number,
  radius: number,
  letter: string,
  colour: string,
  onto: string,
): void {
  context.save();
  context.translate(x, y);
  context.scale(1, -1);
  context.fillStyle = colour;
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  context.fill();
  context.fillStyle = onto;
  // Fonts smaller than a pixel are not drawn, so the letter is written large and made small.
  context.scale(radius / 10, radius / 10);
  context.font = "bold 13px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(letter, 0, 1);
  context.restore();
}

export interface Moving {
  drive: Drive;
  way: Way;
  /** Its number among the drives that are shown. */
  number: number;
  /** Whether it is shown alone, so that colours may tell other things. */
  alone: boolean;
}

/** What moves: the way so far, the planned path, what the laser sees, and the robot. */
export function drawMoving(
  context: CanvasRenderingContext2D,
  { drive, way, number, alone }: Moving,
  time: number,
  camera: Camera,
  colours: Colours,
): void {
  const own = colours.drives[number % colours.drives.length]!;
  const pixel = 1 / camera.scale;
  const shown = Math.min(time, drive.duration);
  context.lineJoin = "round";
  context.strokeStyle = own;
  context.lineWidth = 2.5 * pixel;
  way.draw(context, shown);
  const plan = drive.planAt(shown);
  if (plan) {
    context.strokeStyle = alone ? colours.plan : own;
    context.lineWidth = 2 * pixel;
    context.setLineDash([7 * pixel, 5 * pixel]);
    context.stroke(trace(plan));
    context.setLineDash([]);
  }
  const pose = poseAt(drive.track, shown);
  const scan = drive.scanAt(shown);
  const from = scan && poseAt(drive.track, scan[0]);
  if (from) drawScan(context, scan![1], from, pixel, alone ? colours.scan : own);
  if (pose) drawRobot(context, drive, pose, shown, own, colours.ground, pixel);
}

function drawScan(context: CanvasRenderingContext2D, points: number[], from: Pose, pixel: number, colour: string): void {
  const [cos, sin] = [Math.cos(from.yaw) / 100, Math.sin(from.yaw) / 100];
  const size = 3 * pixel;
  context.fillStyle = colour;
  context.beginPath();
  for (let i = 0; i < points.length; i += 2) {
    const x = from.x + cos * points[i]! - sin * points[i + 1]!;
    const y = from.y + sin * points[i]! + cos * points[i + 1]!;
    context.rect(x - size / 2, y - size / 2, size, size);
  }
  context.fill();
}

function drawRobot(
  context: CanvasRenderingContext2D,
  drive: Drive,
  pose: Pose,
  time: number,
  colour: string,
  onto: string,
  pixel: number,
): void {
  const radius = (drive.answer.planned.diameter ?? USUAL_DIAMETER) / 2;
  const outline = drive.footprintAt(time);
  context.globalAlpha = pose.age ? 0.35 : 1;
  context.fillStyle = colour;
  context.strokeStyle = onto;
  context.lineWidth = 1.5 * pixel;
  if (outline && outline.length > 2) {
    const path = trace(outline);
    path.closePath();
    context.fill(path);
  }
  context.save();
  context.translate(pose.x, pose.y);
  context.rotate(pose.yaw);
  if (!outline) {
    context.beginPath();
    context.arc(0, 0, Math.max(radius, 4 * pixel), 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
  const nose = Math.max(radius, 4 * pixel);
  context.fillStyle = onto;
  context.beginPath();
  context.moveTo(0.8 * nose, 0);
  context.lineTo(-0.35 * nose, 0.5 * nose);
  context.lineTo(-0.35 * nose, -0.5 * nose);
  context.fill();
  context.restore();
  context.globalAlpha = 1;
}

/** A length that is a round number of metres and fits a scale bar. */
export function barLength(scale: number): number {
  const most = 120 / scale;
  const power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].map((step) => step * power).find((length) => length <= most) ?? power;
}

export function drawBar(context: CanvasRenderingContext2D, camera: Camera, size: Size, pixels: number, colours: Colours): void {
  const length = barLength(camera.scale);
  context.setTransform(pixels, 0, 0, pixels, 0, 0);
  context.strokeStyle = context.fillStyle = colours.text;
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(12, size.height - 12);
  context.lineTo(12 + length * camera.scale, size.height - 12);
  context.stroke();
  context.font = "12px system-ui, sans-serif";
  context.textBaseline = "bottom";
  context.fillText(PLAYER.scale(length), 12, size.height - 16);
}
