import { expect, test } from "vitest";
import { fitting, zoomed } from "./camera";
import { joined, lastUpTo, poseAt, speedAt, stoodStill, type Part, type Track } from "./drive";

const track: Track = { times: [0, 1, 5, 6], x: [0, 2, 2, 2], y: [0, 0, 0, 0], yaw: [3, -3, 0, 0] };

test("a moment between two poses is between them, by the shorter turn", () => {
  const pose = poseAt(track, 0.5)!;
  expect([pose.x, pose.age]).toEqual([1, 0]);
  expect(Math.cos(pose.yaw)).toBeCloseTo(-1);
  expect(speedAt(track, 0.5)).toBeCloseTo(2);
});

test("in a gap the robot stays where it was seen last, and its age is told", () => {
  expect(poseAt(track, 1.5)).toEqual({ x: 2, y: 0, yaw: -3, age: 0 });
  expect(poseAt(track, 4)).toEqual({ x: 2, y: 0, yaw: -3, age: 3 });
  expect(speedAt(track, 4)).toBeNull();
  expect(poseAt(track, -1)).toBeNull();
});

test("the last value up to a limit is found", () => {
  expect([-1, 0, 2.5, 9].map((limit) => lastUpTo([0, 1, 2], limit))).toEqual([-1, 0, 2, 2]);
  expect(lastUpTo([], 1)).toBe(-1);
});

test("parts are joined in time, those that are missing left out", () => {
  const part = (times: number[]): Part => ({
    ...{ times, x: times, y: times, yaw: times },
    ...{ scans: [], plans: [], footprints: [], remarks: [] },
    events: [[times[0]!, "log", "info", "a", "b"]],
  });
  const found = joined([part([0, 1]), undefined, part([0.9, 2, 3])]);
  expect(found.times).toEqual([0, 1, 2, 3]);
  expect(found.events.map((event) => event[0])).toEqual([0, 0.9]);
});

test("a robot that never moved is noticed", () => {
  expect(stoodStill(track)).toBe(false);
  expect(stoodStill({ ...track, x: [1, 1.01, 1, 1] })).toBe(true);
  expect(stoodStill({ times: [], x: [], y: [], yaw: [] })).toBe(false);
});

test("zooming keeps the point in place that is zoomed into", () => {
  const size = { width: 200, height: 100 };
  const before = fitting([0, 0, 10, 10], size);
  expect([before.x, before.y, before.scale]).toEqual([5, 5, 9.5]);
  const after = zoomed(before, 2, size, { x: 150, y: 50 });
  expect(after.scale).toBe(19);
  expect(after.x + 50 / after.scale).toBeCloseTo(before.x + 50 / before.scale);
});
