// A recorded drive: what is known of it so far, and what it was like at a moment.
import { address, ask, askFiles, type Verdict } from "../api";
import { PLAYER } from "../text";

export type Point = [number, number];

/** A map in runs of equal cells, row by row from the lowest: length and kind of each. */
export interface Ground {
  columns: number;
  rows: number;
  resolution: number;
  x: number;
  y: number;
  yaw: number;
  runs: number[];
}

export interface DriveAnswer {
  overview: {
    duration: number;
    started: number;
    simulated: boolean;
    /** Where parts begin, and where the last one ends [s]. */
    bounds: number[];
    topics: Record<string, string>;
    remarks: string[];
  } | null;
  ground: Ground | null;
  planned: {
    diameter: number | null;
    start: number[] | null;
    goals: number[][];
    path: Point[];
    /** x, y, radius, or x, y, yaw, length, width. */
    obstacles: number[][];
  };
  verdict: Verdict | null;
  remarks: string[];
}

/** What stands still. */
export type Still = Pick<DriveAnswer, "ground" | "planned">;

/** Time, kind, level or status, source, text. */
export type Happening = [number, "log" | "behavior", string, string, string];

export interface Part {
  times: number[];
  x: number[];
  y: number[];
  yaw: number[];
  /** Time, and x, y, x, y, … seen from the robot [cm]. */
  scans: [number, number[]][];
  plans: [number, Point[]][];
  footprints: [number, Point[]][];
  events: Happening[];
  remarks: string[];
}

/** What a camera saw; later parts of a drive have other objects. */
export interface Sight {
  time: number;
  picture: Blob;
}

interface PicturesAnswer {
  /** Time, media type, size. */
  frames: [number, string, number][];
  remarks: string[];
}

export interface Pose {
  x: number;
  y: number;
  yaw: number;
  /** How long ago the robot was there [s]; 0 while poses come in. */
  age: number;
}

export interface Track {
  times: number[];
  x: number[];
  y: number[];
  yaw: number[];
}

/** Without a pose for longer, nobody knows where the robot is [s]. */
export const GAP = 1;
const SCAN_LASTS = 1;
const STANDS = 0.05;
/** Parts on either side whose scans are kept. */
const NEAR = 4;

/** Index of the last value that is not above a limit; -1 if there is none. */
export function lastUpTo(values: ArrayLike<number>, limit: number): number {
  let low = 0;
  let high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle]! <= limit) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

export function poseAt(track: Track, time: number): Pose | null {
  const { times, x, y, yaw } = track;
  const before = lastUpTo(times, time);
  if (before < 0) return null;
  const after = before + 1;
  const span = after < times.length ? times[after]! - times[before]! : Infinity;
  if (span > GAP) {
    const age = time - times[before]!;
    return { x: x[before]!, y: y[before]!, yaw: yaw[before]!, age: age > GAP ? age : 0 };
  }
  const share = span > 0 ? (time - times[before]!) / span : 0;
  const turn = Math.atan2(Math.sin(yaw[after]! - yaw[before]!), Math.cos(yaw[after]! - yaw[before]!));
  return {
    x: x[before]! + share * (x[after]! - x[before]!),
    y: y[before]! + share * (y[after]! - y[before]!),
    yaw: yaw[before]! + share * turn,
    age: 0,
  };
}

/** Speed over the quarter of a second up to a moment [m/s]; null where it is not known. */
export function speedAt(track: Track, time: number): number | null {
  const now = poseAt(track, time);
  const then = poseAt(track, time - 0.25);
  return now && then && !now.age && !then.age ? Math.hypot(now.x - then.x, now.y - then.y) / 0.25 : null;
}

/** All parts that are there, one after the other in time. */
export function joined(parts: (Part | undefined)[]): Track & { events: Happening[] } {
  const track: Track = { times: [], x: [], y: [], yaw: [] };
  const events: Happening[] = [];
  for (const part of parts) {
    part?.times.forEach((time, i) => {
      if (time < (track.times.at(-1) ?? 0)) return; // a little that came out of order
      track.times.push(time);
      track.x.push(part.x[i]!);
      track.y.push(part.y[i]!);
      track.yaw.push(part.yaw[i]!);
    });
    for (const event of part?.events ?? []) events.push(event);
  }
  return { ...track, events: events.sort((a, b) => a[0] - b[0]) };
}

export function stoodStill(track: Track): boolean {
  const wide = (values: number[]) => values.reduce((most, value) => Math.max(most, Math.abs(value - values[0]!)), 0);
  return track.times.length > 0 && Math.max(wide(track.x), wide(track.y)) < STANDS;
}

/** A drive that is read part by part, the part that is looked at first. */
export class Drive {
  track: ReturnType<typeof joined> = joined([]);
  /** Grows whenever a part has come. */
  version = 0;
  readonly remarks = new Set<string>();
  private readonly parts: (Part | undefined)[] = [];
  private readonly withScans = new Set<number>();
  private readonly sights = new Map<number, Sight[]>();
  private readonly failed = new Set<number>();
  private asking = false;
  private readonly stopped = new AbortController();

  constructor(
    private readonly path: string[],
    readonly answer: DriveAnswer,
    private readonly tell: () => void,
    /** Whether more than way and events is read. */
    private readonly whole = true,
  ) {
    for (const remark of [...answer.remarks, ...(answer.overview?.remarks ?? [])]) this.remarks.add(remark);
  }

  get key(): string {
    return this.path.join("/");
  }

  get duration(): number {
    return this.answer.overview?.duration ?? 0;
  }

  get bounds(): number[] {
    return this.answer.overview?.bounds ?? [0];
  }

  get count(): number {
    return this.bounds.length - 1;
  }

  partAt(time: number): number {
    return Math.min(Math.max(lastUpTo(this.bounds, time), 0), Math.max(0, this.count - 1));
  }

  has(number: number): boolean {
    return this.parts[number] !== undefined || this.failed.has(number);
  }

  /** Whether a moment can be shown. */
  isReady(time: number): boolean {
    const number = this.partAt(time);
    return this.count === 0 || this.withScans.has(number) || this.failed.has(number);
  }

  get isComplete(): boolean {
    return this.bounds.every((_, number) => number >= this.count || this.has(number));
  }

  /** Read what a moment needs, then what follows, then the rest. */
  want(time: number): void {
    if (this.asking || this.stopped.signal.aborted) return;
    const now = this.partAt(time);
    const open = (number: number) => number < this.count && !this.withScans.has(number) && !this.failed.has(number);
    const near = this.whole ? [now, now + 1] : [];
    const scanned = near.find(open);
    const unseen = this.hasCamera ? near.find((number) => number < this.count && !this.sights.has(number)) : undefined;
    if (scanned !== undefined) void this.read(scanned, true, time);
    else if (unseen !== undefined) void this.look(unseen, time);
    else {
      const other = this.nearest(now);
      if (other !== undefined) void this.read(other, false, time);
    }
  }

  get hasCamera(): boolean {
    return this.answer.overview?.topics.camera !== undefined;
  }

  stop(): void {
    this.stopped.abort();
  }

  /** Say what cannot be shown. */
  remark(text: string): void {
    this.remarks.add(text);
    this.version++;
    this.tell();
  }

  scanAt(time: number): [number, number[]] | null {
    const found = this.latest("scans", time, 1);
    return found && time - found[0] <= SCAN_LASTS ? found : null;
  }

  /** What the camera saw last. */
  sightAt(time: number): Sight | null {
    const now = this.partAt(time);
    const known = [now - 1, now].flatMap((number) => this.sights.get(number) ?? []);
    return known[lastUpTo(known.map((sight) => sight.time), time)] ?? null;
  }

  planAt(time: number): Point[] | null {
    return this.latest("plans", time, this.count)?.[1] ?? null;
  }

  footprintAt(time: number): Point[] | null {
    const found = this.latest("footprints", time, 1);
    return found && time - found[0] <= SCAN_LASTS ? found[1] : null;
  }

  private latest<K extends "scans" | "plans" | "footprints">(kind: K, time: number, back: number): Part[K][number] | null {
    const now = this.partAt(time);
    for (let number = now; number >= Math.max(0, now - back); number--) {
      const all = this.parts[number]?.[kind] ?? [];
      let at = all.length - 1;
      while (at >= 0 && all[at]![0] > time) at--;
      if (at >= 0) return all[at]!;
    }
    return null;
  }

  private nearest(now: number): number | undefined {
    for (let away = 0; away < this.count; away++) {
      for (const number of [now + away, now - away]) {
        if (number >= 0 && number < this.count && !this.has(number)) return number;
      }
    }
    return undefined;
  }

  private async read(number: number, scans: boolean, time: number): Promise<void> {
    this.asking = true;
    try {
      const part = await ask<Part>(
        address(["drive", ...this.path, String(number)], { scans: scans ? 1 : undefined }),
        this.stopped.signal,
      );
      this.parts[number] = part;
      if (scans) this.withScans.add(number);
      part.remarks.forEach((remark) => this.remarks.add(remark));
    } catch (cause) {
      if (this.stopped.signal.aborted) return;
      this.failed.add(number);
      this.remarks.add((cause as Error).message);
    }
    this.asking = false;
    this.forget(this.partAt(time));
    this.track = joined(this.parts);
    if (this.isComplete) this.conclude();
    this.version++;
    this.tell();
  }

  private async look(number: number, time: number): Promise<void> {
    this.asking = true;
    const sights: Sight[] = [];
    try {
      const url = address(["drive", ...this.path, String(number), "pictures"]);
      const [{ frames, remarks }, files] = await askFiles<PicturesAnswer>(url, this.stopped.signal);
      let at = 0;
      for (const [place, type, size] of frames) sights.push({ time: place, picture: files.slice(at, (at += size), type) });
      remarks.forEach((remark) => this.remarks.add(remark));
    } catch (cause) {
      if (this.stopped.signal.aborted) return;
      this.remarks.add((cause as Error).message);
    }
    this.sights.set(number, sights);
    this.asking = false;
    this.forget(this.partAt(time));
    this.version++;
    this.tell();
  }

  /** Drop scans and pictures of parts that are far from the one that is looked at. */
  private forget(now: number): void {
    for (const number of this.sights.keys()) {
      if (Math.abs(number - now) > NEAR) this.sights.delete(number);
    }
    for (const number of this.withScans) {
      if (Math.abs(number - now) > NEAR) {
        this.parts[number]!.scans = [];
        this.withScans.delete(number);
      }
    }
  }

  private conclude(): void {
    if (stoodStill(this.track)) this.remarks.add(PLAYER.stoodStill);
    if (this.answer.overview?.topics.pose && this.track.times.length === 0) {
      this.remarks.add(`${this.answer.overview.topics.pose} has no pose that can be shown.`);
    }
  }
}
