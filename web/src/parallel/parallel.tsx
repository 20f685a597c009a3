// Parallel coordinates: a line per configuration through what was varied and what came of it.
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { Columns } from "../api";
import { brief, others, type Run, type Shown } from "../data";
import { namesAsOptions } from "../factors";

import type { Option } from "../parts";
import { Pick } from "../pick";
import { choose, joined, split } from "../route";
import { COMMON, GROUPS, PARALLEL } from "../text";
import { axisAt, drawAxes, drawLine, drawLines, placeAt, type Colours, type Frame, type Lines } from "./paint";
import {
  inBrush,
  moved,
  nearest,
  outcomes,
  RESULTS,
  scaleOf,
  writeBrush,
  type Brush,
  type Outcomes,
  type Scale,
} from "./scales";

const HEIGHT = 300;
/** Axes at first; one may choose more. */
const MOST_AXES = 12;
/** Least room of an axis [px]. */
const AXIS = 110;
/** How near the pointer must be to an axis [px], and to a line as a share of the height. */
const GRIP = 14;
const REACH = 0.04;

interface ParallelProps {
  data: Columns;
  runs: Run[];
  /** Factors that vary. */
  names: string[];
  measure: Shown | null;
  /** Axes as the address has them. */
  axes: string;
  brush: Brush;
}

export function Parallel({ data, runs, names, measure, axes, brush }: ParallelProps) {
  const found = useMemo(() => outcomes(data, runs, measure), [data, runs, measure]);
  const usual = [
    ...names.slice(0, MOST_AXES).map((name) => `p:${name}`),
    ...RESULTS.filter((id) => id !== "measure" || measure),
  ];
  const ids = axes ? split(axes) : usual;
  const scales = useMemo(
    () => ids.map((id) => scaleOf(data, found, id, measure)).filter((scale) => scale !== null),
    [data, found, ids.join("\n"), measure],
  );
  const set = (ids: string[]) => choose({ axes: ids.join() === usual.join() ? "" : joined(ids) });
  const shown = scales.map(({ id }) => id);
  const parameters = useMemo(() => namesAsOptions(data, names, others(data)), [data, names]);
  const options: Option[] = [
    ...parameters.map(([name, text, group]): Option => [`p:${name}`, text, group]),
    ["duration", COMMON.meanDuration, GROUPS.results],
    ...(measure ? [["measure", COMMON.mean(measure.name), GROUPS.results] as Option] : []),
    ["rate", COMMON.failureRate, GROUPS.results],
  ];
  return (
    <>
      <div class="tools">
        <Pick
          label={PARALLEL.axes}
          text={String(scales.length)}
          several
          options={options}
          chosen={shown}
          onChoose={(id, on) => set(on ? [...shown, id] : shown.filter((one) => one !== id))}
          onReset={() => choose({ axes: "", brush: "" })}
        />
        <span class="quiet">
          {PARALLEL.hint}
        </span>
      </div>
      {scales.length > 0 && <Chart {...{ data, found, scales, brush }} onMove={(id, to) => set(moved(shown, id, to))} />}
      {scales.length === 0 && <p class="hint">{PARALLEL.none}</p>}
    </>
  );
}

interface ChartProps {
  data: Columns;
  found: Outcomes;
  scales: Scale[];
  brush: Brush;
  onMove: (id: string, to: number) => void;
}

/** What is being chosen of an axis, while the pointer is down. */
interface Drag {
  id: string;
  from: number;
  to: number;
}

function Chart({ data, found, scales, brush, onMove }: ChartProps) {
  const frame = useFrame();
  const [drag, setDrag] = useState<Drag | null>(null);
  const [hovered, setHovered] = useState(-1);
  const chosen = useMemo(() => withDrag(brush, drag, scales), [brush, drag, scales]);
  const all = useMemo(() => linesOf(found), [found]);
  const lines = useMemo(() => chosenOf(all, scales, chosen), [all, scales, chosen]);
  const isPart = lines.variants.length < all.variants.length;
  const { width } = frame.size;
  useEffect(() => setHovered(-1), [lines]);
  const back = usePainted(frame.size, frame.colours, (pen, colours) => drawLines(pen, frame.size, scales, all, colours, true), [scales, all, isPart]);
  const front = usePainted(frame.size, frame.colours, (pen, colours) => {
    drawLines(pen, frame.size, scales, lines, colours);
    drawAxes(pen, frame.size, scales.map((scale) => partOf(scale, chosen)), colours);
  }, [scales, lines, chosen]);
  const top = usePainted(frame.size, frame.colours, (pen, { text }) => {
    if (hovered < 0) return;
    pen.lineWidth = 2.5;
    pen.strokeStyle = text;
    drawLine(pen, frame.size, scales, hovered);
  }, [scales, hovered]);
  const column = (x: number) => (x * scales.length) / width - 0.5;
  const down = (event: PointerEvent) => {
    const near = Math.round(column(event.offsetX));
    const isOn = Math.abs(axisAt(near, scales.length, width) - event.offsetX) <= GRIP;
    if (event.button !== 0 || event.pointerType === "touch" || !isOn || !scales[near]) return;
    (event.currentTarget as Element).setPointerCapture(event.pointerId);
    const place = placeAt(event.offsetY, frame.size);
    setHovered(-1); // the click that follows is meant for the axis
    setDrag({ id: scales[near]!.id, from: place, to: place });
  };
  const move = ({ offsetX, offsetY }: PointerEvent) => {
    const place = placeAt(offsetY, frame.size);
    if (drag) setDrag({ ...drag, to: place });
    else setHovered(nearest(lines.variants, scales, column(offsetX), place, REACH));
  };
  const up = () => {
    if (!drag) return;
    setDrag(null);
    choose({ brush: writeBrush(chosen) });
  };
  const open = () => drag === null && hovered >= 0 && choose({ q: `variant=${data.variants.name[hovered]}` });
  const text = PARALLEL.chart(found.variants.length, scales.map((s) => s.label));
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={PARALLEL.label}>
      <div class="parallel" style={{ minWidth: `${AXIS * scales.length}px`, "--axes": scales.length }}>
        {scales.map((scale, index) => (
          <Name key={scale.id} {...{ scale, index }} room={width / scales.length} onMove={(to) => onMove(scale.id, to)} />
        ))}
        {scales.map(({ id, high }) => (
          <span key={id} class="end" title={high}>
            {high}
          </span>
        ))}
        <div class="lines" ref={frame.ref} role="img" aria-label={text} style={{ height: `${HEIGHT}px` }}>
          {isPart && <canvas ref={back} />}
          <canvas ref={front} />
          <canvas
            ref={top}
            onPointerDown={down}
            onPointerMove={move}
            onPointerUp={up}
            onPointerCancel={() => setDrag(null)}
            onPointerLeave={() => setHovered(-1)}
            onClick={open}
          />
        </div>
        {scales.map(({ id, low }) => (
          <span key={id} class="end" title={low}>
            {low}
          </span>
        ))}
      </div>
      <p class="about-line" aria-hidden="true">
        {hovered >= 0 ? <About {...{ data, found, scales }} variant={hovered} /> : " "}
      </p>
    </div>
  );
}

/** An axis's name, which moves it. */
function Name({ scale, index, room, onMove }: { scale: Scale; index: number; room: number; onMove: (to: number) => void }) {
  const [from, setFrom] = useState<number | null>(null);
  const [by, setBy] = useState(0);
  const keyed = ({ key }: KeyboardEvent) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[key];
    if (step) onMove(index + step);
  };
  const drop = () => {
    const steps = Math.round(by / room);
    setFrom(null);
    setBy(0);
    if (steps) onMove(index + steps);
  };
  return (
    <button
      type="button"
      class="axis"
      title={PARALLEL.move(scale.label)}
      style={by ? { transform: `translateX(${by}px)` } : undefined}
      onKeyDown={keyed}
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        setFrom(event.clientX);
      }}
      onPointerMove={(event) => from !== null && setBy(event.clientX - from)}
      onPointerUp={drop}
      onPointerCancel={drop}
    >
      {scale.label}
    </button>
  );
}

function About({ data, found, scales, variant }: { data: Columns; found: Outcomes; scales: Scale[]; variant: number }) {
  const values = scales.filter(({ id }) => id.startsWith("p:"));
  const value = ({ id }: Scale) => brief(data.variants.values[id.slice(2)]![variant]);
  return (
    <>
      <b>{data.variants.name[variant]}</b> {PARALLEL.rate(found.rate[variant]!)}
      {values.map((scale) => ` · ${scale.label} ${value(scale)}`).join("")}
    </>
  );
}

/** What is chosen, with what the pointer is choosing; a click on an axis chooses all of it again. */
function withDrag(brush: Brush, drag: Drag | null, scales: Scale[]): Brush {
  const scale = drag && scales.find(({ id }) => id === drag.id);
  if (!scale) return brush;
  const { [drag.id]: _, ...rest } = brush;
  if (Math.abs(drag.to - drag.from) < 0.02) return rest;
  const [low, high] = [Math.min(drag.from, drag.to), Math.max(drag.from, drag.to)];
  return { ...rest, [drag.id]: [scale.at(low), scale.at(high)] };
}

function partOf(scale: Scale, brush: Brush): [number, number] | null {
  const ends = brush[scale.id];
  const [low, high] = ends ? [scale.of(ends[0]), scale.of(ends[1])] : [NaN, NaN];
  return Number.isNaN(low) || Number.isNaN(high) ? null : [low, high];
}

function linesOf({ rate, variants }: Outcomes): Lines {
  const worst = variants.reduce((most, variant) => Math.max(most, rate[variant]!), 0.01);
  return { variants, rate, worst };
}

/** The lines in every chosen part; the others lie behind, which need not be drawn again meanwhile. */
function chosenOf(all: Lines, scales: Scale[], brush: Brush): Lines {
  const test = inBrush(brush, (id) => scales.find((scale) => scale.id === id) ?? null);
  return { ...all, variants: all.variants.filter(test) };
}

/** The size of what is drawn on, and its colours; both may change. */
function useFrame() {
  const ref = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState<Frame>({ width: 0, height: HEIGHT });
  const [colours, setColours] = useState<Colours | null>(null);
  useEffect(() => {
    const element = ref.current!; // an observer may report once more when it is gone
    const observer = new ResizeObserver(() => setSize({ width: element.clientWidth, height: HEIGHT }));
    observer.observe(element);
    const read = () => setColours(coloursOf(element));
    read();
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", read);
    return () => {
      observer.disconnect();
      dark.removeEventListener("change", read);
    };
  }, []);
  return { ref, size, colours };
}

function coloursOf(element: Element): Colours {
  const style = getComputedStyle(element);
  const colour = (name: string) => style.getPropertyValue(`--${name}`).trim();
  return {
    good: colour("passed"),
    bad: colour("failed"),
    quiet: colour("quiet"),
    line: colour("line"),
    marked: colour("marked"),
    text: colour("text"),
  };
}

type Painter = (pen: CanvasRenderingContext2D, colours: Colours) => void;

/** A canvas that is painted when what it shows changes, once for each picture of the screen. */
function usePainted(size: Frame, colours: Colours | null, paint: Painter, shown: unknown[]) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const element = canvas.current;
    if (!element || !colours || !size.width) return;
    const next = requestAnimationFrame(() => {
      const ratio = devicePixelRatio;
      element.width = size.width * ratio;
      element.height = size.height * ratio;
      const pen = element.getContext("2d")!;
      pen.scale(ratio, ratio);
      paint(pen, colours);
    });
    return () => cancelAnimationFrame(next);
  }, [size.width, size.height, colours, ...shown]);
  return canvas;
}
