// The picture of one or several drives at a moment; it is moved and zoomed with mouse or fingers.
import { useEffect, useRef } from "preact/hooks";
import { extent, fitting, moved, zoomed, type Box, type Camera, type Size } from "./camera";
import { poseAt, type Drive } from "./drive";
import { coloursOf, drawBar, drawMoving, drawOthers, drawStill, inMetres, pictureOf, Way, type Colours } from "./paint";

export interface View {
  /** Null while everything is shown. */
  camera: Camera | null;
  follow: boolean;
}

/** What the player does with a picture. */
export interface Picture {
  draw: (time: number) => void;
  /** The camera nearer to what is shown, or farther away; only of a map. */
  zoomed?: (factor: number) => Camera;
}

interface StageProps {
  drives: Drive[];
  /** Other runs, whose whole ways are shown. */
  others: Drive[];
  /** Number of the first drive, which determines its colour. */
  first: number;
  label: string;
  view: View;
  onView: (view: View) => void;
  /** Called when the picture can be drawn, and when it is gone. */
  onReady: (picture: Picture, gone: boolean) => void;
}

export function Stage({ drives, others, first, label, view, onView, onReady }: StageProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const latest = useRef({ drives, others, view, onView });
  latest.current = { drives, others, view, onView };
  useEffect(() => {
    const stage = new Painter(canvas.current!, first, latest.current.drives);
    const picture: Picture = {
      draw: (time) => {
        stage.others = latest.current.others;
        stage.draw(time, latest.current.view);
      },
      zoomed: (factor) => zoomed(stage.camera, factor, stage.size),
    };
    const off = controls(canvas.current!, stage, (next) => latest.current.onView(next), () => latest.current.view);
    onReady(picture, false);
    return () => {
      off();
      stage.close();
      onReady(picture, true);
    };
  }, [drives.map((drive) => drive.key).join(), first]);
  return <canvas ref={canvas} class="stage" role="img" aria-label={label} />;
}

class Painter {
  size: Size = { width: 1, height: 1 };
  camera: Camera = { x: 0, y: 0, scale: 1 };
  others: Drive[] = [];
  private readonly context: CanvasRenderingContext2D;
  private readonly still = document.createElement("canvas");
  private readonly dark = matchMedia("(prefers-color-scheme: dark)");
  private readonly observer: ResizeObserver;
  private colours: Colours;
  private picture: HTMLCanvasElement | null = null;
  private stillOf = "";
  private ways: { version: number; way: Way }[] = [];
  private box: Box | null = null;
  private boxOf = -1;
  private pixels = 1;
  private last = 0;
  private lastView: View = { camera: null, follow: false };

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly first: number,
    private readonly drives: Drive[],
  ) {
    this.context = canvas.getContext("2d", { alpha: false })!;
    this.colours = coloursOf(canvas);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(canvas);
    this.dark.addEventListener("change", this.repaint);
    this.repaint();
    this.resize();
  }

  close(): void {
    this.observer.disconnect();
    this.dark.removeEventListener("change", this.repaint);
  }

  draw(time: number, view: View): void {
    this.last = time;
    this.lastView = view;
    this.camera = this.aim(time, view);
    this.drawBehind();
    inMetres(this.context, this.camera, this.size, this.pixels);
    this.drives.forEach((drive, i) => {
      const moving = { drive, way: this.way(i), number: this.first + i, alone: this.drives.length === 1 };
      drawMoving(this.context, moving, time, this.camera, this.colours);
    });
    drawBar(this.context, this.camera, this.size, this.pixels, this.colours);
  }

  private readonly repaint = () => {
    this.colours = coloursOf(this.canvas);
    const ground = this.drives.find((drive) => drive.answer.ground)?.answer.ground;
    this.picture = ground ? pictureOf(ground, this.colours) : null;
    this.stillOf = "";
    this.draw(this.last, this.lastView);
  };

  private resize(): void {
    this.pixels = Math.min(devicePixelRatio || 1, 2);
    this.size = { width: Math.max(1, this.canvas.clientWidth), height: Math.max(1, this.canvas.clientHeight) };
    for (const canvas of [this.canvas, this.still]) {
      canvas.width = this.size.width * this.pixels;
      canvas.height = this.size.height * this.pixels;
    }
    this.stillOf = "";
    this.draw(this.last, this.lastView);
  }

  private aim(time: number, view: View): Camera {
    const camera = view.camera ?? fitting(this.whole(), this.size);
    const pose = view.follow && poseAt(this.drives[0]!.track, Math.min(time, this.drives[0]!.duration));
    return pose ? { ...camera, x: pose.x, y: pose.y } : camera;
  }

  /** Everything that is known of the drives. */
  private whole(): Box {
    const version = this.drives.reduce((sum, drive) => sum + drive.version, 0);
    if (!this.box || this.boxOf !== version) {
      const boxes = this.drives.map((drive) => extent(drive.answer, drive.track));
      this.box = boxes.reduce((a, b) => [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[2], b[2]), Math.max(a[3], b[3])]);
      this.boxOf = version;
    }
    return this.box;
  }

  private way(i: number): Way {
    const drive = this.drives[i]!;
    const known = this.ways[i];
    if (known?.version === drive.version) return known.way;
    const way = new Way(drive.track);
    this.ways[i] = { version: drive.version, way };
    return way;
  }

  /** What stands still is drawn only when the camera has moved. */
  private drawBehind(): void {
    const { x, y, scale } = this.camera;
    const wanted = [x, y, scale, ...this.others.map((drive) => `${drive.key} ${drive.version}`)].join();
    if (wanted !== this.stillOf) {
      const context = this.still.getContext("2d", { alpha: false })!;
      context.setTransform(1, 0, 0, 1, 0, 0);
      context.fillStyle = this.colours.ground;
      context.fillRect(0, 0, this.still.width, this.still.height);
      inMetres(context, this.camera, this.size, this.pixels);
      drawStill(context, this.drives[0]!.answer, this.picture, this.camera, this.colours);
      drawOthers(context, this.others, this.camera, this.colours);
      this.stillOf = wanted;
    }
    this.context.setTransform(1, 0, 0, 1, 0, 0);
    this.context.drawImage(this.still, 0, 0);
  }
}

/** Moving with mouse or one finger, zooming with two fingers, or the wheel and Ctrl. */
function controls(canvas: HTMLCanvasElement, stage: Painter, onView: (view: View) => void, view: () => View): () => void {
  const fingers = new Map<number, { x: number; y: number }>();
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return a && b ? Math.hypot(a.x - b.x, a.y - b.y) : 0;
  };
  const place = (event: PointerEvent | WheelEvent) => ({ x: event.offsetX, y: event.offsetY });
  const down = (event: PointerEvent) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, place(event));
  };
  const move = (event: PointerEvent) => {
    const from = fingers.get(event.pointerId);
    if (!from) return;
    const to = place(event);
    const before = spread();
    fingers.set(event.pointerId, to);
    const dragged = moved(stage.camera, (to.x - from.x) / fingers.size, (to.y - from.y) / fingers.size);
    const camera = before ? zoomed(dragged, spread() / before, stage.size, to) : dragged;
    onView({ camera, follow: before ? view().follow : false });
  };
  const up = (event: PointerEvent) => fingers.delete(event.pointerId);
  const wheel = (event: WheelEvent) => {
    if (!event.ctrlKey && !event.metaKey && !canvas.closest(":focus-within")) return; // the page is scrolled
    event.preventDefault();
    onView({ camera: zoomed(stage.camera, Math.exp(-event.deltaY / 400), stage.size, place(event)), follow: view().follow });
  };
  canvas.addEventListener("pointerdown", down);
  canvas.addEventListener("pointermove", move);
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("wheel", wheel, { passive: false });
  return () => {
    canvas.removeEventListener("pointerdown", down);
    canvas.removeEventListener("pointermove", move);
    canvas.removeEventListener("pointerup", up);
    canvas.removeEventListener("pointercancel", up);
    canvas.removeEventListener("wheel", wheel);
  };
}
