// Small maps of configurations: how often each fails, the ways of its runs, and where they ended.
import { useEffect, useRef, useState } from "preact/hooks";
import { address, type Columns, type Verdict } from "../api";
import { variantOf, verdictOf, type Run } from "../data";

import { useAnswer } from "../live";
import { Prose, Waiting } from "../parts";
import { link } from "../route";
import { MAPS } from "../text";
import { extent, fitting, wallsOf, type Size } from "./camera";
import type { DriveAnswer, Ground, Point } from "./drive";
import { FailureMaps } from "./failure-map";
import { coloursOf, drawEnd, drawThinWay, drawStill, inMetres, pictureOf } from "./paint";

/** Maps that are shown at once. */
const STEP = 24;

interface MapsAnswer {
  grounds: Ground[];
  configurations: { name: string; ground: number | null; planned: DriveAnswer["planned"]; ways: [number, Point[]][] }[];
}

interface Group {
  name: string;
  runs: Run[];
  bad: number;
}

/** The configurations of some runs, those that fail most often first. */
export function grouped(data: Columns, runs: Run[]): Group[] {
  const groups = new Map<string, Group>();
  for (const run of runs) {
    const verdict = verdictOf(data, run);
    if (verdict === "interrupted") continue;
    const name = variantOf(data, run);
    const group = groups.get(name) ?? { name, runs: [], bad: 0 };
    group.runs.push(run);
    if (verdict !== "passed") group.bad += 1;
    groups.set(name, group);
  }
  return [...groups.values()].sort((a, b) => b.bad / b.runs.length - a.bad / a.runs.length);
}

/** Maps of the configurations of some runs. */
export function Maps({ data, runs }: { data: Columns; runs: Run[] }) {
  const [shown, setShown] = useState(STEP);
  const groups = grouped(data, runs);
  const pages = [];
  for (let begin = 0; begin < Math.min(shown, groups.length); begin += STEP) {
    pages.push(<Page key={groups[begin]!.name} data={data} groups={groups.slice(begin, begin + STEP)} />);
  }
  return (
    <>
      <p class="quiet">
        <Prose text={MAPS.hint} />
      </p>
      <FailureMaps data={data} runs={runs} />
      <h2>{MAPS.title}</h2>
      {pages}
      {shown < groups.length && (
        <button type="button" onClick={() => setShown(shown + STEP)}>
          {MAPS.more(groups.length)}
        </button>
      )}
    </>
  );
}

function Page({ data, groups }: { data: Columns; groups: Group[] }) {
  const { name } = data.summary;
  const { data: maps, error } = useAnswer<MapsAnswer>(address(["maps", name], { variant: groups.map((group) => group.name) }));
  if (!maps) return <Waiting error={error} />;
  if (!maps.grounds.length && maps.configurations.every(({ ways }) => !ways.length)) {
    return <p class="hint">{MAPS.none}</p>;
  }
  return (
    <ul class="maps">
      {groups.map((group) => (
        <li key={group.name}>
          <MapOf {...{ data, group, maps }} />
        </li>
      ))}
    </ul>
  );
}

function MapOf({ data, group, maps }: { data: Columns; group: Group; maps: MapsAnswer }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const found = maps.configurations.find((one) => one.name === group.name);
  const verdicts = new Map(group.runs.map((run) => [data.runs.number[run]!, verdictOf(data, run)]));
  useEffect(() => {
    const element = canvas.current!;
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const draw = () => found && drawSmall(element, found, maps, verdicts);
    const observer = new ResizeObserver(draw);
    observer.observe(element);
    dark.addEventListener("change", draw);
    return () => {
      observer.disconnect();
      dark.removeEventListener("change", draw);
    };
  }, [maps, data]);
  const worst = group.runs.find((run) => verdictOf(data, run) !== "passed") ?? group.runs[0]!;
  const share = group.bad / group.runs.length;
  return (
    <a href={link(["campaign", data.summary.name, group.name, data.runs.number[worst]!], { tab: "player", everyone: group.runs.length > 1 ? "1" : "" })}>
      <canvas ref={canvas} aria-hidden="true" />
      <span class="rated" style={{ "--share": `${(100 * share).toFixed(1)}%` }}>
        {MAPS.thumbnail(group.name, share, group.bad, group.runs.length)}
      </span>
    </a>
  );
}

function drawSmall(
  canvas: HTMLCanvasElement,
  { ground, planned, ways }: MapsAnswer["configurations"][number],
  { grounds }: MapsAnswer,
  verdicts: Map<number, Verdict>,
): void {
  const pixels = Math.min(devicePixelRatio || 1, 2);
  const size: Size = { width: canvas.clientWidth, height: canvas.clientHeight };
  canvas.width = size.width * pixels;
  canvas.height = size.height * pixels;
  const context = canvas.getContext("2d")!;
  const colours = coloursOf(canvas);
  const floor = ground === null ? null : grounds[ground]!;
  const still = { ground: floor, planned };
  const walls = floor && wallsOf(floor);
  const all = ways.flatMap(([, way]) => way);
  const camera = fitting(walls ?? extent(still, { x: all.map(([x]) => x), y: all.map(([, y]) => y) }), size);
  inMetres(context, camera, size, pixels);
  drawStill(context, still, floor && pictureOf(floor, colours), camera, colours);
  const judged = ways.flatMap(([number, way]) => (verdicts.has(number) ? [{ way, verdict: verdicts.get(number)! }] : []));
  for (const { way, verdict } of judged) drawThinWay(context, way, verdict, camera, colours);
  for (const { way, verdict } of judged) drawEnd(context, ...way.at(-1)!, verdict, camera, colours);
}
