// Curves over a common axis.
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { PLOT } from "./text";

export interface Curve {
  label: string;
  values: (number | null)[];
  /** Name of a colour of the page, and a width [px], in place of the next ones. */
  colour?: string;
  width?: number;
}

interface PlotProps {
  label: string;
  x: Curve;
  curves: Curve[];
  format?: (value: number) => string;
  /** Let the axis begin at 0. */
  fromZero?: boolean;
  height?: number;
  legend?: boolean;
}

/** Steps of an axis that counts: nothing lies between two numbers. */
const WHOLE = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9].flatMap((power) => [1, 2, 5].map((step) => step * 10 ** power));
const DASHES = [[], [8, 4], [2, 3], [10, 3, 2, 3]];

export function Plot({ label, x, curves, format, fromZero = false, height = 260, legend = true }: PlotProps) {
  const frame = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const element = frame.current!;
    const dark = matchMedia("(prefers-color-scheme: dark)");
    let plot: uPlot | null = null;
    const width = () => Math.max(200, element.clientWidth);
    const build = () => {
      plot?.destroy();
      plot = new uPlot(
        { ...options(element, x.label, curves, fromZero, x.values.every(Number.isInteger), format), width: width(), height, ...(legend ? {} : { legend: { show: false } }) },
        [x.values as number[], ...curves.map((curve) => curve.values)],
        element,
      );
    };
    build();
    const observer = new ResizeObserver(() => plot?.setSize({ width: width(), height }));
    observer.observe(element);
    dark.addEventListener("change", build);
    return () => {
      observer.disconnect();
      dark.removeEventListener("change", build);
      plot?.destroy();
    };
  }, [x, curves]);
  return <div class="plot" ref={frame} role="img" aria-label={PLOT.label(label, curves.map((c) => c.label), x.label)} />;
}

/** Room for the numbers of an axis [px]. */
function widthOf(_: uPlot, labels: string[] | null): number {
  return 24 + 8 * Math.max(4, ...(labels ?? []).map((label) => label.length));
}

function options(
  element: Element,
  xLabel: string,
  curves: Curve[],
  fromZero: boolean,
  counts: boolean,
  format?: (value: number) => string,
): Omit<uPlot.Options, "width" | "height"> {
  const style = getComputedStyle(element);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  const axis = {
    stroke: colour("--quiet"),
    grid: { stroke: colour("--line"), width: 1 },
    ticks: { stroke: colour("--line"), width: 1 },
    font: `12px ${style.fontFamily}`,
  };
  return {
    scales: { x: { time: false }, y: fromZero ? { range: (_, __, most) => [0, 1.1 * most || 1] } : {} },
    axes: [
      { ...axis, space: 80, ...(counts ? { incrs: WHOLE } : {}), label: xLabel, labelFont: `12px ${style.fontFamily}`, labelSize: 18 },
      { ...axis, size: widthOf, values: format && ((_, splits) => splits.map((value) => format(value))) },
    ],
    legend: { show: curves.length > 1 || Boolean(format) },
    series: [
      { label: xLabel },
      ...curves.map((curve, index) => ({
        label: curve.label,
        stroke: colour(curve.colour ?? `--curve-${(index % 6) + 1}`),
        dash: curve.colour ? [] : DASHES[Math.floor(index / 6) % DASHES.length],
        width: curve.width ?? 1.6,
        points: { show: !curve.width && curve.values.length < 60 },
        spanGaps: Boolean(curve.width), // of several tables, each has values of its own times alone
        value: format && ((_: uPlot, value: number | null) => (value === null ? "–" : format(value))),
      })),
    ],
    cursor: { drag: { x: true, y: false } },
  };
}
