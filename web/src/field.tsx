// Sets of a search as dots over two axes, on the failure map where there is one.
import { useEffect, useRef, useState } from "preact/hooks";
import { contour } from "./contours";
import { beside, nearest, type MapAnswer, type SetsAnswer } from "./search-data";
import { SEARCH } from "./text";

const HEIGHT = 420;
const MARGIN = { left: 76, right: 18, top: 12, bottom: 46 };
const REACH = 14;
const ARROWS: Record<string, [number, number]> = {
  ArrowRight: [1, 0],
  ArrowLeft: [-1, 0],
  ArrowDown: [0, 1],
  ArrowUp: [0, -1],
};

export interface FieldProps {
  label: string;
  sets: SetsAnswer;
  map: MapAnswer | null;
  /** Whether the map is still that of another place. */
  isLate: boolean;
  /** Whether the map's colour is how wide its interval is. */
  unsure: boolean;
  /** Whether lines are drawn where the rate is at the level: not between choices. */
  lined: boolean;
  /** Values that have no colour and full colour. */
  scale: [number, number];
  /** What is said of a set. */
  describe: (set: number) => string;
  open: (set: number) => void;
}

interface Dot {
  x: number;
  y: number;
  set: number;
}

export function Field(props: FieldProps) {
  const { label, sets, map, isLate, unsure, lined, scale, describe, open } = props;
  const canvas = useRef<HTMLCanvasElement>(null);
  const dots = useRef<Dot[]>([]);
  const [chosen, setChosen] = useState<number | null>(null);
  useEffect(() => setChosen(null), [sets]);
  useEffect(() => {
    const element = canvas.current!;
    const redraw = () => (dots.current = draw(element, props, chosen));
    const observer = new ResizeObserver(redraw);
    observer.observe(element);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", redraw);
    return () => {
      observer.disconnect();
      dark.removeEventListener("change", redraw);
    };
  }, [sets, map, unsure, lined, scale[0], scale[1], chosen]);
  const under = (event: MouseEvent) => {
    const found = nearest(dots.current, event.offsetX, event.offsetY, REACH);
    return found === null ? null : dots.current[found]!.set;
  };
  const move = (event: KeyboardEvent) => {
    const way = ARROWS[event.key];
    if (event.key === "Enter" && chosen !== null) open(chosen);
    if (!way) return;
    event.preventDefault();
    const from = dots.current.findIndex(({ set }) => set === chosen);
    const next = beside(dots.current, from < 0 ? null : from, way);
    if (next !== null) setChosen(dots.current[next]!.set);
  };
  const onClick = (event: MouseEvent) => {
    const found = under(event);
    if (found !== null) open(found);
  };
  return (
    <>
      <div class={`field ${isLate ? "late" : ""}`} tabIndex={0} role="application" aria-busy={isLate} aria-label={`${label}. ${SEARCH.keys}`} onKeyDown={move}>
        <canvas
          ref={canvas}
          aria-hidden="true"
          style={{ height: `${HEIGHT}px`, cursor: chosen === null ? undefined : "pointer" }}
          onMouseMove={(event) => setChosen(under(event))}
          onClick={onClick}
        />
      </div>
      <p class="quiet note" role="status">
        {chosen !== null ? describe(chosen) : sets.config.length ? SEARCH.dots : SEARCH.noScores}
      </p>
    </>
  );
}

function draw(canvas: HTMLCanvasElement, props: FieldProps, chosen: number | null): Dot[] {
  const { sets, map, unsure, lined, scale } = props;
  const [width, height, ratio] = [canvas.clientWidth, HEIGHT, devicePixelRatio];
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const pen = canvas.getContext("2d")!;
  pen.scale(ratio, ratio);
  const style = getComputedStyle(canvas);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  const [plotWidth, plotHeight] = [width - MARGIN.left - MARGIN.right, height - MARGIN.top - MARGIN.bottom];
  const x = (place: number) => MARGIN.left + place * plotWidth;
  const y = (place: number) => MARGIN.top + (1 - place) * plotHeight;

  pen.save();
  pen.beginPath();
  pen.rect(x(0), y(1), plotWidth, plotHeight);
  pen.clip();
  if (map) {
    const ramp = rampOf(colour("--low"), colour(unsure ? "--high-measure" : "--high-rate"));
    paint(pen, map, unsure, ramp, x, y);
    if (lined) drawLines(pen, map, colour("--text"), x, y);
  }
  pen.restore();
  drawCells(pen, sets, colour("--line"), x, y);
  const shades = rampOf(colour("--low"), colour("--high-rate"));
  const dots = placed(sets, x, y);
  drawDots(pen, dots, props, chosen, { shade: (value) => css(shades, (value - scale[0]) / (scale[1] - scale[0] || 1)), edge: colour("--text") });
  drawAxes(pen, sets, { x, y, text: colour("--text"), quiet: colour("--quiet"), line: colour("--line"), family: style.fontFamily });
  return dots;
}

function placed(sets: SetsAnswer, x: (place: number) => number, y: (place: number) => number): Dot[] {
  return sets.config
    .map((_, set) => ({ x: x(sets.x.places[set]!), y: y(sets.y.places[set]!), set }))
    .filter(({ set }) => sets.x.places[set]! >= 0 && sets.y.places[set]! >= 0);
}

type Pens = { shade: (value: number) => string; edge: string };

function drawDots(pen: CanvasRenderingContext2D, dots: Dot[], { sets }: FieldProps, chosen: number | null, { shade, edge }: Pens): void {
  const radius = dots.length > 2000 ? 2 : dots.length > 400 ? 3 : 4.5;
  const best = new Set(sets.best);
  pen.strokeStyle = edge;
  // What is best lies on top.
  for (const { x, y, set } of [...dots].sort((a, b) => Number(best.has(a.set)) - Number(best.has(b.set)))) {
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fillStyle = shade(sets.value[set]!);
    pen.fill();
    pen.lineWidth = best.has(set) && best.size < dots.length / 2 ? 2 : 0.8;
    pen.stroke();
  }
  const at = dots.find(({ set }) => set === chosen);
  if (!at) return;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.arc(at.x, at.y, radius + 5, 0, 2 * Math.PI);
  pen.stroke();
}

/** Colours from none to full, as bytes. */
function rampOf(from: string, to: string): Uint8ClampedArray {
  const canvas = document.createElement("canvas");
  canvas.width = 256;
  canvas.height = 1;
  const pen = canvas.getContext("2d", { willReadFrequently: true })!;
  for (let step = 0; step < 256; step++) {
    pen.fillStyle = `color-mix(in oklab, ${to} ${(100 * step) / 255}%, ${from})`;
    pen.fillRect(step, 0, 1, 1);
  }
  return pen.getImageData(0, 0, 256, 1).data;
}

function stepOf(share: number): number {
  return 4 * Math.round(255 * Math.min(1, Math.max(0, share)));
}

function css(ramp: Uint8ClampedArray, share: number): string {
  const at = stepOf(share);
  return `rgb(${ramp[at]} ${ramp[at + 1]} ${ramp[at + 2]})`;
}

/** The map as a picture with a pixel for each point, as large as the axes. */
function paint(
  pen: CanvasRenderingContext2D,
  map: MapAnswer,
  unsure: boolean,
  ramp: Uint8ClampedArray,
  x: (place: number) => number,
  y: (place: number) => number,
): void {
  const picture = document.createElement("canvas");
  picture.width = map.width;
  picture.height = map.height;
  const context = picture.getContext("2d")!;
  const image = context.createImageData(map.width, map.height);
  map.rate.forEach((rate, index) => {
    const share = (unsure ? map.high[index]! - map.low[index]! : rate) / 1000;
    const row = map.height - 1 - Math.floor(index / map.width);
    const pixel = 4 * (row * map.width + (index % map.width));
    image.data.set(ramp.subarray(stepOf(share), stepOf(share) + 4), pixel);
  });
  context.putImageData(image, 0, 0);
  // A point is the middle of its pixel.
  const [left, right] = ends(map.x);
  const [low, high] = ends(map.y);
  pen.imageSmoothingEnabled = map.x[0] === 0 && map.y[0] === 0;
  pen.drawImage(picture, x(left), y(high), x(right) - x(left), y(low) - y(high));
}

function ends(places: number[]): [number, number] {
  const half = places.length > 1 ? (places[1]! - places[0]!) / 2 : 0.5;
  return [places[0]! - half, places.at(-1)! + half];
}

/** Solid where the rate is the level; broken where the ends of its interval are. */
function drawLines(
  pen: CanvasRenderingContext2D,
  map: MapAnswer,
  text: string,
  x: (place: number) => number,
  y: (place: number) => number,
): void {
  const lines: [number[], number[], number][] = [
    [map.rate, [], 2],
    [map.low, [6, 4], 1.2],
    [map.high, [2, 3], 1.2],
  ];
  pen.strokeStyle = text;
  for (const [values, dash, width] of lines) {
    pen.setLineDash(dash);
    pen.lineWidth = width;
    pen.beginPath();
    for (const [x1, y1, x2, y2] of contour(values, map.x, map.y, 1000 * map.level)) {
      pen.moveTo(x(x1), y(y1));
      pen.lineTo(x(x2), y(y2));
    }
    pen.stroke();
  }
  pen.setLineDash([]);
}

/** The cells of an archive. */
function drawCells(
  pen: CanvasRenderingContext2D,
  sets: SetsAnswer,
  line: string,
  x: (place: number) => number,
  y: (place: number) => number,
): void {
  pen.strokeStyle = line;
  pen.lineWidth = 1;
  pen.beginPath();
  for (let part = 1; part < sets.x.bins; part++) {
    pen.moveTo(x(part / sets.x.bins), y(0));
    pen.lineTo(x(part / sets.x.bins), y(1));
  }
  for (let part = 1; part < sets.y.bins; part++) {
    pen.moveTo(x(0), y(part / sets.y.bins));
    pen.lineTo(x(1), y(part / sets.y.bins));
  }
  pen.stroke();
}

interface AxisPens {
  x: (place: number) => number;
  y: (place: number) => number;
  text: string;
  quiet: string;
  line: string;
  family: string;
}

function drawAxes(pen: CanvasRenderingContext2D, sets: SetsAnswer, { x, y, text, quiet, line, family }: AxisPens): void {
  pen.strokeStyle = line;
  pen.lineWidth = 1;
  pen.strokeRect(x(0), y(1), x(1) - x(0), y(0) - y(1));
  pen.font = `12px ${family}`;
  pen.fillStyle = quiet;
  pen.textBaseline = "top";
  let free = -Infinity;
  for (const [place, label] of sets.x.ticks) {
    const shown = fitted(pen, label, 110);
    const width = pen.measureText(shown).width;
    const left = Math.min(Math.max(x(place) - width / 2, 0), x(1) + MARGIN.right - width);
    if (left < free) continue;
    pen.textAlign = "left";
    pen.fillText(shown, left, y(0) + 6);
    free = left + width + 8;
  }
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  free = Infinity;
  for (const [place, label] of sets.y.ticks) {
    if (y(place) > free) continue;
    pen.fillText(fitted(pen, label, MARGIN.left - 26), x(0) - 6, y(place));
    free = y(place) - 14;
  }
  pen.fillStyle = text;
  pen.textAlign = "center";
  pen.textBaseline = "bottom";
  pen.fillText(fitted(pen, sets.x.name, x(1) - x(0)), x(0.5), HEIGHT - 4);
  pen.save();
  pen.translate(4, y(0.5));
  pen.rotate(-Math.PI / 2);
  pen.textBaseline = "top";
  pen.fillText(fitted(pen, sets.y.name, y(0) - y(1)), 0, 0);
  pen.restore();
}

function fitted(pen: CanvasRenderingContext2D, label: string, room: number): string {
  if (pen.measureText(label).width <= room) return label;
  let end = label.length;
  while (end > 1 && pen.measureText(`${label.slice(0, end)}…`).width > room) end -= 1;
  return `${label.slice(0, end)}…`;
}
