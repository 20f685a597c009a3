// Parallel coordinates: a line per configuration through all its parameters.
import { useEffect, useMemo, useRef } from "preact/hooks";
import type { Columns } from "./api";
import { order, show, valueOf, verdictOf, type Run } from "./data";

const HEIGHT = 340;
const MARGIN = { top: 46, bottom: 16, side: 70 };
const MOST_AXES = 12;
/** Least room of an axis [px]. */
const AXIS = 120;

interface ParallelProps {
  data: Columns;
  runs: Run[];
  names: string[];
}

interface Scale {
  label: string;
  low: string;
  high: string;
  place: (variant: number) => number;
}

export function Parallel({ data, runs, names }: ParallelProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const variants = useMemo(() => summaries(data, runs), [data, runs]);
  const scales = useMemo(
    () => [
      ...names.slice(0, MOST_AXES).map((name) => parameterScale(data, name)),
      resultScale("mean duration [s]", variants, (variant) => variant.duration),
      resultScale("failure rate", variants, (variant) => variant.rate),
    ],
    [data, names.join(), variants],
  );
  useEffect(() => {
    const element = canvas.current!;
    const redraw = () => draw(element, scales, variants);
    const observer = new ResizeObserver(redraw);
    observer.observe(element);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", redraw);
    return () => {
      observer.disconnect();
      dark.removeEventListener("change", redraw);
    };
  }, [scales, variants]);
  const text = `Parallel coordinates of ${variants.size} configurations over ${scales.map((s) => s.label).join(", ")}`;
  const size = { height: `${HEIGHT}px`, minWidth: `${AXIS * scales.length}px` };
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label="Parallel coordinates">
      <canvas ref={canvas} class="parallel" role="img" aria-label={text} style={size} />
    </div>
  );
}

interface VariantResult {
  rate: number;
  duration: number | null;
}

function summaries(data: Columns, runs: Run[]): Map<number, VariantResult> {
  const sums = new Map<number, { runs: number; bad: number; sum: number; measured: number }>();
  for (const run of runs) {
    const verdict = verdictOf(data, run);
    if (verdict === "interrupted") continue;
    const variant = data.runs.variant[run]!;
    const sum = sums.get(variant) ?? { runs: 0, bad: 0, sum: 0, measured: 0 };
    sums.set(variant, sum);
    sum.runs += 1;
    sum.bad += Number(verdict !== "passed");
    const duration = valueOf(data, run, "duration");
    if (typeof duration === "number") {
      sum.sum += duration;
      sum.measured += 1;
    }
  }
  return new Map(
    [...sums].map(([variant, sum]) => [
      variant,
      { rate: sum.bad / sum.runs, duration: sum.measured ? sum.sum / sum.measured : null },
    ]),
  );
}

function parameterScale(data: Columns, name: string): Scale {
  const values = data.variants.values[name]!;
  if (values.every((value) => typeof value === "number")) {
    return numberScale(name, values, (variant) => values[variant] as number);
  }
  const different = [...new Map(values.map((value) => [show(value), value])).values()].sort(order).map(show);
  const place = new Map(different.map((value, index) => [value, index]));
  const most = Math.max(1, different.length - 1);
  return {
    label: name,
    low: different[0] ?? "",
    high: different.at(-1) ?? "",
    place: (variant) => place.get(show(values[variant]))! / most,
  };
}

function resultScale(
  label: string,
  variants: Map<number, VariantResult>,
  value: (variant: VariantResult) => number | null,
): Scale {
  const values = [...variants.values()].map(value).filter((one) => one !== null);
  return numberScale(label, values, (variant) => value(variants.get(variant)!) ?? 0);
}

function numberScale(label: string, values: number[], value: (variant: number) => number): Scale {
  const low = values.reduce((a, b) => Math.min(a, b), Infinity);
  const high = values.reduce((a, b) => Math.max(a, b), -Infinity);
  const short = (number: number) => (Number.isFinite(number) ? show(Number(number.toPrecision(4))) : "");
  const place = (variant: number) => (high > low ? (value(variant) - low) / (high - low) : 0.5);
  return { label, low: short(low), high: short(high), place };
}

function draw(canvas: HTMLCanvasElement, scales: Scale[], variants: Map<number, VariantResult>): void {
  const width = canvas.clientWidth;
  const ratio = devicePixelRatio;
  canvas.width = width * ratio;
  canvas.height = HEIGHT * ratio;
  const pen = canvas.getContext("2d")!;
  pen.scale(ratio, ratio);
  const style = getComputedStyle(canvas);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  const x = (index: number) => MARGIN.side + (index * (width - 2 * MARGIN.side)) / (scales.length - 1);
  const y = (share: number) => HEIGHT - MARGIN.bottom - share * (HEIGHT - MARGIN.top - MARGIN.bottom);
  pen.lineWidth = 1.2;
  const worst = Math.max(...[...variants.values()].map((variant) => variant.rate), 0.01);
  const [good, bad] = [colour("--passed"), colour("--failed")];
  pen.globalAlpha = Math.max(0.08, Math.min(0.8, 60 / variants.size));
  // Bad ones last, so that they lie on top.
  for (const [variant, result] of [...variants].sort((a, b) => a[1].rate - b[1].rate)) {
    const share = Math.round((100 * result.rate) / worst);
    pen.strokeStyle = `color-mix(in oklab, ${bad} ${share}%, ${good})`;
    pen.beginPath();
    scales.forEach((scale, index) => pen.lineTo(x(index), y(scale.place(variant))));
    pen.stroke();
  }
  pen.globalAlpha = 1;
  pen.font = `12px ${style.fontFamily}`;
  pen.textAlign = "center";
  scales.forEach((scale, index) => {
    pen.strokeStyle = colour("--line");
    pen.beginPath();
    pen.moveTo(x(index), y(0));
    pen.lineTo(x(index), y(1));
    pen.stroke();
    pen.fillStyle = colour("--text");
    pen.fillText(scale.label, x(index), 14);
    pen.fillStyle = colour("--quiet");
    pen.fillText(scale.high, x(index), MARGIN.top - 8);
    pen.fillText(scale.low, x(index), HEIGHT - 2);
  });
}
