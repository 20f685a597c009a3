// Lines on which numbers over a grid have one value.

export type Segment = [x1: number, y1: number, x2: number, y2: number];

/** The pieces of the line where `values`, row by row over the places `x` and `y`, are `level`. */
export function contour(values: number[], x: number[], y: number[], level: number): Segment[] {
  const found: Segment[] = [];
  const at = (i: number, j: number) => values[j * x.length + i]! - level;
  for (let j = 0; j + 1 < y.length; j++) {
    for (let i = 0; i + 1 < x.length; i++) {
      const corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
      const spots = [
        [x[i]!, y[j]!],
        [x[i + 1]!, y[j]!],
        [x[i + 1]!, y[j + 1]!],
        [x[i]!, y[j + 1]!],
      ] as const;
      const cuts: [number, number][] = [];
      for (let edge = 0; edge < 4; edge++) {
        const next = (edge + 1) % 4;
        const [one, other] = [corners[edge]!, corners[next]!];
        if ((one < 0) === (other < 0)) continue;
        const part = one / (one - other);
        const [a, b] = [spots[edge]!, spots[next]!];
        cuts.push([a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])]);
      }
      for (let cut = 0; cut + 1 < cuts.length; cut += 2) found.push([...cuts[cut]!, ...cuts[cut + 1]!]);
    }
  }
  return found;
}
