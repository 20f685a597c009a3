// Log messages and behaviours of a drive: on its time line, and as a list.
import { useEffect, useRef } from "preact/hooks";
import { PLAYER } from "../text";
import { lastUpTo, type Drive, type Happening } from "./drive";

const HEIGHT = 26;
const AROUND = 40;

/** Colour variable of an event; quiet ones are drawn low. */
function look([, kind, level]: Happening): { colour: string; high: number } {
  if (level === "error" || level === "fatal" || level === "failure") return { colour: "--failed", high: 1 };
  if (level === "warn") return { colour: "--curve-5", high: 0.8 };
  if (level === "success") return { colour: "--passed", high: 0.7 };
  return { colour: kind === "behavior" ? "--curve-4" : "--quiet", high: 0.45 };
}

/** Marks along the time line: what happened, and which parts are not there yet. */
export function Marks({ drive, version, duration }: { drive: Drive; version: number; duration: number }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const element = canvas.current!;
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const draw = () => drawMarks(element, drive, duration);
    const observer = new ResizeObserver(draw);
    observer.observe(element);
    dark.addEventListener("change", draw);
    return () => {
      observer.disconnect();
      dark.removeEventListener("change", draw);
    };
  }, [drive, version, duration]);
  return <canvas ref={canvas} class="marks" height={HEIGHT} aria-hidden="true" data-complete={drive.isComplete || undefined} />;
}

function drawMarks(canvas: HTMLCanvasElement, drive: Drive, duration: number): void {
  const pixels = devicePixelRatio || 1;
  const width = canvas.clientWidth;
  canvas.width = width * pixels;
  canvas.height = HEIGHT * pixels;
  const context = canvas.getContext("2d")!;
  context.scale(pixels, pixels);
  const style = getComputedStyle(canvas);
  const at = (time: number) => (time / (duration || 1)) * width;
  context.fillStyle = style.getPropertyValue("--line");
  for (let number = 0; number < drive.count; number++) {
    const [begin, end] = [at(drive.bounds[number]!), at(drive.bounds[number + 1]!)];
    if (!drive.has(number)) context.fillRect(begin, HEIGHT - 4, end - begin, 2);
  }
  for (const event of drive.track.events) {
    const { colour, high } = look(event);
    context.fillStyle = style.getPropertyValue(colour);
    context.fillRect(Math.min(at(event[0]), width - 2), HEIGHT * (1 - high) - 2, 2, HEIGHT * high);
  }
}

interface HappeningsProps {
  drive: Drive;
  time: number;
  onSeek: (time: number) => void;
}

/** What happened shortly before and after a moment. */
export function Happenings({ drive, time, onSeek }: HappeningsProps) {
  const { events } = drive.track;
  const list = useRef<HTMLOListElement>(null);
  const now = lastUpTo(events.map((event) => event[0]), time + 1e-3);
  const begin = Math.max(0, now - AROUND);
  const shown = events.slice(begin, now + AROUND);
  useEffect(() => {
    const frame = list.current;
    const current = frame?.querySelector<HTMLElement>("[aria-current]");
    if (frame && current) frame.scrollTop = current.offsetTop - frame.clientHeight / 2;
  }, [now]);
  if (events.length === 0) return <p class="hint">{drive.isComplete ? PLAYER.noEvents : PLAYER.notYet}</p>;
  return (
    <ol class="happenings" ref={list}>
      {shown.map((event, i) => {
        const [at, , level, source, text] = event;
        return (
          <li key={`${begin + i}`} class={level}>
            <button type="button" aria-current={begin + i === now ? "time" : undefined} onClick={() => onSeek(at)}>
              <span class="at">{PLAYER.at(at)}</span> <span class="node">{source}</span>{" "}
              <span>
                {level === "info" || text.toLowerCase() === level ? "" : `${level}: `}
                {text}
              </span>
            </button>
          </li>
        );
      })}
    </ol>
  );
}
