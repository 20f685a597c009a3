// Draws lines through axes: each by itself, or as many as one likes by how densely they lie.
import type { Scale } from "./scales";

export interface Colours {
  good: string;
  bad: string;
  quiet: string;
  line: string;
  marked: string;
  text: string;
}

export interface Lines {
  variants: number[];
  /** Share of bad runs by configuration, and the largest. */
  rate: Float32Array;
  worst: number;
}

/** Up to here each line is drawn by itself. */
const FEW = 400;
/** Heights that dense lines are told apart by: so the work has a bound, however many there are. */
const ROWS = 128;
/** How wide a column of dense lines is [px]. */
const GRAIN = 2;

export interface Frame {
  width: number;
  height: number;
}

/** Of an axis, from the left edge [px]. */
export function axisAt(index: number, axes: number, width: number): number {
  return ((index + 0.5) * width) / axes;
}

/** Of a place between 0 and 1, from the upper edge [px]. */
export function heightAt(place: number, { height }: Frame): number {
  return EDGE + (1 - place) * (height - 2 * EDGE);
}

export function placeAt(y: number, { height }: Frame): number {
  return Math.max(0, Math.min(1, 1 - (y - EDGE) / (height - 2 * EDGE)));
}

const EDGE = 6;

/** All lines, in one colour if `plain`. */
export function drawLines(
  pen: CanvasRenderingContext2D,
  frame: Frame,
  scales: Scale[],
  lines: Lines,
  colours: Colours,
  plain = false,
): void {
  if (lines.variants.length > FEW) drawDensity(pen, frame, scales, lines, colours, plain);
  else drawEach(pen, frame, scales, lines, colours, plain);
}

function drawEach(
  pen: CanvasRenderingContext2D,
  frame: Frame,
  scales: Scale[],
  { variants, rate, worst }: Lines,
  { good, bad, quiet }: Colours,
  plain: boolean,
): void {
  pen.save();
  pen.lineWidth = 1.2;
  pen.globalAlpha = (plain ? 0.3 : 1) * Math.max(0.15, Math.min(0.8, 60 / variants.length));
  // Bad ones last, so that they lie on top.
  for (const variant of variants.toSorted((a, b) => rate[a]! - rate[b]!)) {
    const share = Math.round((100 * rate[variant]!) / worst);
    pen.strokeStyle = plain ? quiet : `color-mix(in oklab, ${bad} ${share}%, ${good})`;
    drawLine(pen, frame, scales, variant);
  }
  pen.restore();
}

/** One line; where nothing is known it has a gap. */
export function drawLine(pen: CanvasRenderingContext2D, frame: Frame, scales: Scale[], variant: number): void {
  pen.beginPath();
  scales.forEach((scale, index) => {
    const place = scale.places[variant]!;
    const isAfterGap = index === 0 || Number.isNaN(scales[index - 1]!.places[variant]!);
    if (Number.isNaN(place)) return;
    const [x, y] = [axisAt(index, scales.length, frame.width), heightAt(place, frame)];
    if (isAfterGap) pen.moveTo(x, y);
    pen.lineTo(x, y);
  });
  pen.stroke();
}

/** How many lines go through each place, and how bad they are. */
function drawDensity(
  pen: CanvasRenderingContext2D,
  frame: Frame,
  scales: Scale[],
  lines: Lines,
  colours: Colours,
  plain: boolean,
): void {
  const wide = frame.width / scales.length;
  const planes = scales.slice(1).map((scale, index) => planeOf(scales[index]!.places, scale.places, lines, Math.ceil(wide / GRAIN)));
  const most = planes.reduce((most, { counts }) => counts.reduce((a, b) => Math.max(a, b), most), 1);
  const grain = (heightAt(0, frame) - heightAt(1, frame)) / (ROWS - 1);
  planes.forEach((plane, index) => {
    const picture = pictureOf(plane, most, colours, plain);
    pen.drawImage(picture, axisAt(index, scales.length, frame.width), heightAt(1, frame) - grain / 2, wide, ROWS * grain);
  });
}

/** What lies between two axes, column by column from the lowest row. */
interface Plane {
  columns: number;
  counts: Float32Array;
  bad: Float32Array;
}

/** Lines that begin and end at the same heights are drawn as one. */
function planeOf(left: Float32Array, right: Float32Array, { variants, rate, worst }: Lines, columns: number): Plane {
  const [counts, bad] = [new Float32Array(ROWS * ROWS), new Float32Array(ROWS * ROWS)];
  for (const variant of variants) {
    const [a, b] = [left[variant]!, right[variant]!];
    if (a !== a || b !== b) continue; // NaN
    const key = ((a * (ROWS - 1) + 0.5) | 0) * ROWS + ((b * (ROWS - 1) + 0.5) | 0);
    counts[key]! += 1;
    bad[key]! += rate[variant]! / worst;
  }
  const drawn = [...counts.keys()].filter((key) => counts[key]! > 0);
  const plane = { columns, counts: new Float32Array(columns * ROWS), bad: new Float32Array(columns * ROWS) };
  // Steep lines go through several rows of a column, and are not denser for that.
  const steps = Math.ceil(ROWS / columns);
  const from = Float32Array.from(drawn, (key) => Math.floor(key / ROWS) + 0.5);
  const rise = Float32Array.from(drawn, (key, place) => (key % ROWS) + 0.5 - from[place]!);
  const count = Float32Array.from(drawn, (key) => counts[key]! / steps);
  const share = Float32Array.from(drawn, (key) => bad[key]! / steps);
  for (let step = 0; step < columns * steps; step++) {
    const begin = Math.floor(step / steps) * ROWS;
    const part = (step + 0.5) / (columns * steps);
    for (let line = 0; line < from.length; line++) {
      const place = begin + ((from[line]! + part * rise[line]!) | 0);
      plane.counts[place]! += count[line]!;
      plane.bad[place]! += share[line]!;
    }
  }
  return plane;
}

function pictureOf({ columns, counts, bad }: Plane, most: number, colours: Colours, plain: boolean): OffscreenCanvas {
  const canvas = new OffscreenCanvas(columns, ROWS);
  const pen = canvas.getContext("2d")!;
  const image = pen.createImageData(columns, ROWS);
  const [from, to] = plain ? [rgb(colours.quiet), rgb(colours.quiet)] : [rgb(colours.good), rgb(colours.bad)];
  const opacity = plain ? 90 : 235;
  for (let place = 0; place < counts.length; place++) {
    const count = counts[place]!;
    if (!count) continue;
    const share = bad[place]! / count;
    const pixel = 4 * ((ROWS - 1 - (place % ROWS)) * columns + Math.floor(place / ROWS));
    for (let part = 0; part < 3; part++) image.data[pixel + part] = from[part]! + share * (to[part]! - from[part]!);
    image.data[pixel + 3] = 20 + opacity * (Math.log1p(count) / Math.log1p(most));
  }
  pen.putImageData(image, 0, 0);
  return canvas;
}

/** Red, green and blue of a colour as CSS writes it. */
function rgb(colour: string): number[] {
  const pen = new OffscreenCanvas(1, 1).getContext("2d")!;
  pen.fillStyle = colour;
  pen.fillRect(0, 0, 1, 1);
  return [...pen.getImageData(0, 0, 1, 1).data.slice(0, 3)];
}

/** The axes, and what is chosen of them as `[low, high]` places. */
export function drawAxes(
  pen: CanvasRenderingContext2D,
  frame: Frame,
  parts: ([number, number] | null)[],
  { line, marked, text }: Colours,
): void {
  parts.forEach((part, index) => {
    const x = axisAt(index, parts.length, frame.width);
    pen.fillStyle = line;
    pen.fillRect(x - 0.5, heightAt(1, frame), 1, heightAt(0, frame) - heightAt(1, frame));
    if (!part) return;
    const [low, high] = [heightAt(part[0], frame) + 3, heightAt(part[1], frame) - 3];
    pen.save();
    pen.globalAlpha = 0.5;
    pen.fillStyle = marked;
    pen.fillRect(x - 7, high, 14, low - high);
    pen.restore();
    pen.strokeStyle = text;
    pen.strokeRect(x - 7, high, 14, low - high);
  });
}
