// Where on their maps the runs of a campaign fail.
import { useEffect, useRef, useState } from "preact/hooks";
import { address, type Columns } from "../api";
import { variantOf, verdictOf, type Run } from "../data";

import { useAnswer } from "../live";
import { Mark } from "../parts";
import { link } from "../route";
import { COMMON, FAILURE_MAP } from "../text";
import { boxOf, fitting, wallsOf, type Box, type Camera, type Size } from "./camera";
import type { Ground, Point } from "./drive";
import { coloursOf, drawStill, inMetres, pictureOf } from "./paint";
import { edgeOf, spotsOf, type Spot } from "./spots";

/** Maps that are shown, those with most failures first. */
const MOST_MAPS = 4;
/** Runs of a place that are listed. */
const MOST_LISTED = 20;
/** How much a failure adds to the light where many are. */
const SHINE = 0.4;

interface FailuresAnswer {
  grounds: Ground[];
  /** Configuration, number of the run, index of the map, x, y. */
  places: [string, number, number | null, number, number][];
}

export interface Failure {
  run: Run;
  at: Point;
}

/** The maps of a campaign with the places where some of its runs failed. */
export function FailureMaps({ data, runs }: { data: Columns; runs: Run[] }) {
  const { data: answer } = useAnswer<FailuresAnswer>(address(["failures", data.summary.name]));
  if (!answer?.places.length) return null;
  const wanted = new Map(runs.map((run) => [`${variantOf(data, run)}/${data.runs.number[run]}`, run]));
  const byMap = new Map<number | null, Failure[]>();
  for (const [variant, number, ground, x, y] of answer.places) {
    const run = wanted.get(`${variant}/${number}`);
    if (run === undefined) continue;
    const known = byMap.get(ground) ?? [];
    known.push({ run, at: [x, y] });
    byMap.set(ground, known);
  }
  const maps = [...byMap].sort((a, b) => b[1].length - a[1].length);
  if (!maps.length) return null;
  return (
    <>
      <h2>{FAILURE_MAP.title}</h2>
      <div class="failure-maps">
        {maps.slice(0, MOST_MAPS).map(([ground, failures]) => (
          <FailureMap key={ground} {...{ data, failures }} ground={ground === null ? null : answer.grounds[ground]!} />
        ))}
      </div>
      {maps.length > MOST_MAPS && <p class="quiet">{FAILURE_MAP.more(maps.length - MOST_MAPS)}</p>}
    </>
  );
}

interface FailureMapProps {
  data: Columns;
  ground: Ground | null;
  failures: Failure[];
}

function FailureMap({ data, ground, failures }: FailureMapProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [view, setView] = useState<{ camera: Camera; size: Size } | null>(null);
  const [chosen, setChosen] = useState<string | null>(null);
  const box = boxAround(ground, failures);
  const spots = spotsOf(failures, box);
  const key = failures.map(({ run }) => run).join();
  useEffect(() => {
    const element = canvas.current!;
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const draw = () => {
      const size = { width: element.clientWidth, height: element.clientHeight };
      const camera = fitting(box, size);
      drawFailures(element, ground, failures, edgeOf(box), camera, size);
      setView({ camera, size });
    };
    const observer = new ResizeObserver(draw);
    observer.observe(element);
    dark.addEventListener("change", draw);
    return () => {
      observer.disconnect();
      dark.removeEventListener("change", draw);
    };
  }, [ground, key]);
  const open = spots.find((spot) => spot.key === chosen);
  return (
    <div>
      <div class="failure-map" role="group" aria-label={FAILURE_MAP.map(failures.length)}>
        <canvas ref={canvas} aria-hidden="true" />
        {view &&
          spots.map((spot) => (
            <SpotMark key={spot.key} {...{ data, spot, view }} isChosen={spot === open} onChoose={() => setChosen(spot === open ? null : spot.key)} />
          ))}
      </div>
      {open && (
        <ul class="spot-runs" aria-label={FAILURE_MAP.runs}>
          {open.runs.slice(0, MOST_LISTED).map((run) => (
            <li key={run}>
              <a href={runLink(data, run)}>
                {variantOf(data, run)}/{data.runs.number[run]}
              </a>{" "}
              <Mark verdict={verdictOf(data, run)} /> <span class="quiet">{data.reasons[data.runs.reason[run]!]}</span>
            </li>
          ))}
          {open.runs.length > MOST_LISTED && <li class="quiet">{COMMON.andMore(open.runs.length - MOST_LISTED)}</li>}
        </ul>
      )}
    </div>
  );
}

/** The player at the moment before the run's end. */
function runLink(data: Columns, run: Run): string {
  return link(["campaign", data.summary.name, variantOf(data, run), data.runs.number[run]!], { tab: "player" });
}

interface SpotMarkProps {
  data: Columns;
  spot: Spot;
  view: { camera: Camera; size: Size };
  isChosen: boolean;
  onChoose: () => void;
}

/** A place where runs failed: one leads to it, of several a list is shown. */
function SpotMark({ data, spot, view: { camera, size }, isChosen, onChoose }: SpotMarkProps) {
  const style = {
    left: `${size.width / 2 + (spot.x - camera.x) * camera.scale}px`,
    top: `${size.height / 2 - (spot.y - camera.y) * camera.scale}px`,
  };
  const failures = FAILURE_MAP.failures(spot.runs.length, spot.x, spot.y);
  if (spot.runs.length > 1) {
    return (
      <button type="button" class="spot" style={style} aria-pressed={isChosen} aria-label={failures} onClick={onChoose}>
        {spot.runs.length}
      </button>
    );
  }
  const run = spot.runs[0]!;
  const name = `${failures}: ${variantOf(data, run)}/${data.runs.number[run]}`;
  return (
    <a class="spot" style={style} href={runLink(data, run)} aria-label={name} title={name}>
      1
    </a>
  );
}

/** All walls, and all ends: a robot may leave its map. */
function boxAround(ground: Ground | null, failures: Failure[]): Box {
  const walls = ground && wallsOf(ground);
  const corners = walls ? [walls.slice(0, 2), walls.slice(2)] : [];
  return boxOf([...corners, ...failures.map(({ at }) => at)])!;
}

function drawFailures(
  canvas: HTMLCanvasElement,
  ground: Ground | null,
  failures: Failure[],
  reach: number,
  camera: Camera,
  size: Size,
): void {
  const pixels = Math.min(devicePixelRatio || 1, 2);
  canvas.width = size.width * pixels;
  canvas.height = size.height * pixels;
  const context = canvas.getContext("2d")!;
  const colours = coloursOf(canvas);
  inMetres(context, camera, size, pixels);
  const planned = { diameter: null, start: null, goals: [], path: [], obstacles: [] };
  drawStill(context, { ground, planned }, ground && pictureOf(ground, colours), camera, colours);
  const glow = glowOf(colours.verdicts.failed);
  for (const { at } of failures) context.drawImage(glow, at[0] - reach, at[1] - reach, 2 * reach, 2 * reach);
}

/** A spot of light that is drawn for each failure, so that where many are is bright. */
function glowOf(colour: string): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const context = canvas.getContext("2d")!;
  context.fillStyle = colour;
  context.fillRect(0, 0, 64, 64);
  const fade = context.createRadialGradient(32, 32, 0, 32, 32, 32);
  fade.addColorStop(0, `rgba(0, 0, 0, ${SHINE})`);
  fade.addColorStop(1, "rgba(0, 0, 0, 0)");
  context.globalCompositeOperation = "destination-in";
  context.fillStyle = fade;
  context.fillRect(0, 0, 64, 64);
  return canvas;
}
