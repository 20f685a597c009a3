// Plays what a run has recorded; another run of the campaign can be played along.
import type { ComponentChildren } from "preact";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { address, ask, type Sibling } from "../api";

import { Glyph, Select, Waiting } from "../parts";
import { choose } from "../route";
import { COMMON, PLAYER } from "../text";
import { Drive, poseAt, speedAt, type DriveAnswer } from "./drive";
import { Happenings, Marks } from "./happenings";
import { Sight } from "./sight";
import { Stage, type Picture, type View } from "./stage";

const SPEEDS = [0.25, 0.5, 1, 2, 5, 10];
/** How often what is written beside the picture is renewed [1/s]. */
const RENEWED = 10;
/** A run that did not pass is shown so long before its end [s]. */
const BEFORE_END = 3;
/** Runs of a configuration whose ways are shown at once. */
const MOST_OTHERS = 50;
/** From when on a picture of the camera is said to be old [s]. */
const OLD = 1;
const STEPS: Record<string, number> = { ArrowLeft: -1, ArrowRight: 1, ",": -0.1, ".": 0.1 };

export interface Place {
  campaign: string;
  variant: string;
  run: string;
}

interface PlayerProps extends Place {
  siblings: Sibling[];
  query: URLSearchParams;
}

export function Player({ campaign, variant, run, siblings, query }: PlayerProps) {
  const [otherVariant, otherRun] = splitPlace(query.get("with") ?? "");
  const own = useDrive({ campaign, variant, run });
  const other = useDrive(otherRun ? { campaign, variant: otherVariant, run: otherRun } : null);
  const everyone = query.get("everyone") === "1";
  const numbers = everyone ? siblings.map(([number]) => String(number)).filter((number) => number !== run) : [];
  const others = useOthers({ campaign, variant }, numbers.slice(0, MOST_OTHERS));
  if (own.error !== null || !own.drive) return <Waiting error={own.error} />;
  const drives = other.drive ? [own.drive, other.drive] : [own.drive];
  return (
    <Playback
      key={`${variant}/${run}`}
      drives={drives}
      others={others}
      version={own.version + other.version + others.reduce((sum, drive) => sum + drive.version, 0)}
      names={[`${variant}/${run}`, `${otherVariant}/${otherRun}`]}
      apart={query.get("show") === "apart"}
      start={Number(query.get("t") ?? NaN)}
      beside={
        <>
          {other.error !== null && <p class="error" role="alert">{other.error}</p>}
          <Other {...{ variant, run, siblings }} chosen={query.get("with") ?? ""} apart={query.get("show") === "apart"} />
          {siblings.length > 1 && (
            <button
              type="button"
              aria-pressed={everyone}
              title={PLAYER.allRunsTitle}
              onClick={() => choose({ everyone: everyone ? "" : "1" })}
            >
              {COMMON.allRuns}
            </button>
          )}
        </>
      }
    />
  );
}

function splitPlace(text: string): [string, string] {
  const at = text.lastIndexOf("/");
  return [text.slice(0, Math.max(at, 0)), text.slice(at + 1)];
}

/** A drive that grows while it is read. */
function useDrive(place: Place | null): { drive: Drive | null; error: string | null; version: number } {
  const [found, setFound] = useState<{ drive: Drive | null; error: string | null }>({ drive: null, error: null });
  const [version, setVersion] = useState(0);
  const path = place && [place.campaign, place.variant, place.run];
  useEffect(() => {
    setFound({ drive: null, error: null });
    if (!path) return;
    const controller = new AbortController();
    let drive: Drive | null = null;
    ask<DriveAnswer>(address(["drive", ...path]), controller.signal).then(
      (answer) => {
        drive = new Drive(path, answer, () => setVersion((known) => known + 1));
        setFound({ drive, error: null });
      },
      (cause: Error) => controller.signal.aborted || setFound({ drive: null, error: cause.message }),
    );
    return () => {
      controller.abort();
      drive?.stop();
    };
  }, [path?.join("/")]);
  return { ...found, version };
}

/** The ways of other runs, read one after the other. */
function useOthers({ campaign, variant }: Omit<Place, "run">, numbers: string[]): Drive[] {
  const [drives, setDrives] = useState<Drive[]>([]);
  useEffect(() => {
    const controller = new AbortController();
    const found: Drive[] = [];
    const tell = () => setDrives([...found]);
    const read = async () => {
      for (const number of numbers) {
        const path = [campaign, variant, number];
        const answer = await ask<DriveAnswer>(address(["drive", ...path]), controller.signal).catch(() => null);
        if (controller.signal.aborted) return;
        if (!answer) continue;
        await new Promise<void>((done) => {
          const drive = new Drive(
            path,
            answer,
            () => {
              tell();
              if (drive.isComplete) done();
              else drive.want(0);
            },
            false,
          );
          controller.signal.addEventListener("abort", () => drive.stop());
          found.push(drive);
          if (drive.isComplete) done();
          else drive.want(0);
        });
      }
    };
    tell();
    void read();
    return () => controller.abort();
  }, [campaign, variant, numbers.join()]);
  return drives;
}

interface OtherProps {
  variant: string;
  run: string;
  siblings: Sibling[];
  chosen: string;
  apart: boolean;
}

/** Chooses a run that is played along, and where. */
function Other({ variant, run, siblings, chosen, apart }: OtherProps) {
  const others = siblings.filter(([number]) => String(number) !== run);
  const options = others.map(([number, verdict]): [string, string] => [`${variant}/${number}`, `${number} (${verdict})`]);
  if (chosen && !options.some(([key]) => key === chosen)) options.push([chosen, chosen]);
  if (options.length === 0) return null;
  return (
    <>
      <Select label={PLAYER.compareWith} value={chosen} options={[["", PLAYER.none], ...options]} onChoose={(next) => choose({ with: next })} />
      {chosen && (
        <button type="button" aria-pressed={apart} onClick={() => choose({ show: apart ? "" : "apart" })}>
          {PLAYER.sideBySide}
        </button>
      )}
    </>
  );
}

interface PlaybackProps {
  drives: Drive[];
  /** Other runs, whose whole ways are shown. */
  others: Drive[];
  version: number;
  names: string[];
  apart: boolean;
  start: number;
  beside: ComponentChildren;
}

function Playback({ drives, others, version, names, apart, start, beside }: PlaybackProps) {
  const duration = Math.max(...drives.map((drive) => drive.duration));
  const main = drives[0]!;
  const [view, setView] = useState<View>({ camera: null, follow: false });
  const [speed, setSpeed] = useState(1);
  const { clock, pictures, time, playing, waiting, seek, play } = useClock(drives, duration, speed, start);
  useEffect(() => pictures.current.forEach((picture) => picture.draw(clock.current)), [view, version, drives.length, apart]);
  const onReady = (picture: Picture, gone: boolean) => {
    if (gone) pictures.current.delete(picture);
    else {
      pictures.current.add(picture);
      picture.draw(clock.current);
    }
  };
  const zoom = (factor: number) => {
    const map = [...pictures.current].find((picture) => picture.zoomed);
    if (map) setView({ ...view, camera: map.zoomed!(factor) });
  };
  const keys: Record<string, () => void> = {
    " ": play,
    Home: () => seek(0),
    End: () => seek(duration),
    "+": () => zoom(1.3),
    "-": () => zoom(1 / 1.3),
    "0": () => setView({ camera: null, follow: false }),
    f: () => setView({ ...view, follow: !view.follow }),
    "]": () => setSpeed(SPEEDS[Math.min(SPEEDS.indexOf(speed) + 1, SPEEDS.length - 1)]!),
    "[": () => setSpeed(SPEEDS[Math.max(SPEEDS.indexOf(speed) - 1, 0)]!),
  };
  const press = (event: KeyboardEvent) => {
    const target = event.target as HTMLElement;
    if (event.ctrlKey || event.metaKey || event.altKey || target.closest("select, summary")) return;
    if (event.key === " " && target.closest("button")) return;
    const step = STEPS[event.key];
    const act = step ? () => seek(clock.current + step * (event.shiftKey ? 10 : 1)) : keys[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  };
  const shown = apart ? drives.map((drive) => [drive]) : [drives];
  return (
    <div class="player" role="region" aria-label={PLAYER.label} tabIndex={0} onKeyDown={press}>
      <div class="scene">
        <div class="stages">
          {shown.map((group, i) => (
            <Stage
              key={group.map((drive) => drive.key).join()}
              drives={group}
              others={others}
              first={i}
              label={PLAYER.map(names.slice(i, i + group.length))}
              view={view}
              onView={setView}
              onReady={onReady}
            />
          ))}
        </div>
        <Sights drives={drives} names={names} onReady={onReady} />
      </div>
      <div class="timeline">
        <Marks drive={main} version={version} duration={duration} />
        <input
          type="range"
          aria-label={PLAYER.time}
          aria-valuetext={PLAYER.timeText(time, duration)}
          min={0}
          max={duration}
          step={0.01}
          value={time}
          disabled={duration === 0}
          onInput={(event) => seek(Number(event.currentTarget.value))}
        />
      </div>
      <div class="tools">
        <button type="button" class="primary" disabled={duration === 0} onClick={play}>
          {playing ? PLAYER.pause : PLAYER.play}
        </button>
        <Select
          label={PLAYER.speed}
          value={String(speed)}
          options={SPEEDS.map((one) => [String(one), `${one} ×`])}
          onChoose={(next) => setSpeed(Number(next))}
        />
        <span class="buttons" role="group" aria-label={PLAYER.view}>
          <button type="button" aria-label={PLAYER.zoomIn} onClick={() => zoom(1.3)}>
            +
          </button>
          <button type="button" aria-label={PLAYER.zoomOut} onClick={() => zoom(1 / 1.3)}>
            −
          </button>
          <button type="button" onClick={() => setView({ camera: null, follow: false })}>
            {PLAYER.showAll}
          </button>
          <button type="button" aria-pressed={view.follow} onClick={() => setView({ ...view, follow: !view.follow })}>
            {PLAYER.follow}
          </button>
        </span>
        {beside}
      </div>
      <ul class="states">
        {drives.map((drive, i) => (
          <State key={drive.key} drive={drive} name={names[i]!} number={i} time={time} waiting={waiting} />
        ))}
      </ul>
      <Everyone others={others} />
      <Lacks drives={drives} names={names} />
      <Happenings drive={main} time={time} onSeek={seek} />
      <details>
        <summary>{PLAYER.keys}</summary>
        <p>
          {PLAYER.keysText}
        </p>
      </details>
    </div>
  );
}

/** The moment that is shown, which goes on by itself while it plays. */
function useClock(drives: Drive[], duration: number, speed: number, start: number) {
  const main = drives[0]!;
  const failed = main.answer.verdict !== null && main.answer.verdict !== "passed";
  const initial = Number.isNaN(start) ? (failed ? Math.max(0, main.duration - BEFORE_END) : 0) : start;
  const clock = useRef(Math.min(Math.max(initial, 0), duration));
  const pictures = useRef(new Set<Picture>());
  const [time, setTime] = useState(clock.current);
  const [playing, setPlaying] = useState(false);
  const [waiting, setWaiting] = useState(false);
  const draw = () => pictures.current.forEach((picture) => picture.draw(clock.current));
  const want = () => drives.forEach((drive) => drive.want(Math.min(clock.current, drive.duration)));
  useEffect(want);
  const seek = (next: number) => {
    clock.current = Math.min(Math.max(next, 0), duration);
    setTime(clock.current);
    draw();
  };
  useEffect(() => {
    if (!playing) return;
    let before = performance.now();
    let told = 0;
    let frame = requestAnimationFrame(function step(now) {
      const ready = drives.every((drive) => drive.isReady(Math.min(clock.current, drive.duration)));
      if (ready) clock.current = Math.min(clock.current + ((now - before) / 1000) * speed, duration);
      before = now;
      draw();
      if (now - told > 1000 / RENEWED || clock.current >= duration) {
        told = now;
        setTime(clock.current);
        setWaiting(!ready);
      }
      if (clock.current >= duration) setPlaying(false);
      else frame = requestAnimationFrame(step);
    });
    return () => cancelAnimationFrame(frame);
  }, [playing, speed, drives.map((drive) => drive.key).join()]);
  useEffect(() => {
    if (playing) return;
    const later = setTimeout(() => choose({ t: clock.current === initial && Number.isNaN(start) ? "" : clock.current.toFixed(2) }), 400);
    return () => clearTimeout(later);
  }, [playing, time]);
  const play = () => {
    if (!playing && clock.current >= duration) clock.current = 0;
    setPlaying(!playing);
  };
  return { clock, pictures, time, playing, waiting, seek, play };
}

interface StateProps {
  drive: Drive;
  name: string;
  number: number;
  time: number;
  waiting: boolean;
}

interface SightsProps {
  drives: Drive[];
  names: string[];
  onReady: (picture: Picture, gone: boolean) => void;
}

/** What the cameras of the robots see. */
function Sights({ drives, names, onReady }: SightsProps) {
  const label = (i: number) => PLAYER.camera(names[i]!);
  if (!drives.some((drive) => drive.hasCamera)) return null;
  return (
    <div class="sights">
      {drives.map((drive, i) => (
        drive.hasCamera && (
          <figure key={drive.key}>
            <Sight drive={drive} label={label(i)} onReady={onReady} />
            <figcaption>
              <span class={`swatch drive-${i}`} aria-hidden="true" />
              {drive.answer.overview!.topics.camera}
            </figcaption>
          </figure>
        )
      ))}
    </div>
  );
}

/** Where a robot is, in words. */
function State({ drive, name, number, time, waiting }: StateProps) {
  const at = Math.min(time, drive.duration);
  const pose = poseAt(drive.track, at);
  const speed = speedAt(drive.track, at);
  const sight = drive.sightAt(at);
  const degrees = (radians: number) => Math.round((Math.atan2(Math.sin(radians), Math.cos(radians)) * 180) / Math.PI);
  const { verdict } = drive.answer;
  return (
    <li>
      <span class={`swatch drive-${number}`} aria-hidden="true" />
      <span class={verdict ? `mark ${verdict}` : "mark"}>
        {verdict && <Glyph verdict={verdict} />}
        {name}
        {verdict && <span class="hidden"> {verdict}</span>}
      </span>{" "}
      <span class="where">
        {PLAYER.clock(at, drive.duration, Boolean(drive.answer.overview?.simulated))}
        {pose && PLAYER.pose(pose.x, pose.y, degrees(pose.yaw))}
        {speed !== null && PLAYER.velocity(speed)}
        {sight && at - sight.time > OLD && PLAYER.oldImage(sight.time)}
        {pose && pose.age > 0 && PLAYER.oldPose(pose.age)}
        {!pose && drive.isReady(at) && PLAYER.noPose}
        {waiting && !drive.isReady(at) && PLAYER.loading}
      </span>
    </li>
  );
}

/** How many of the other runs did not pass, and where they ended. */
function Everyone({ others }: { others: Drive[] }) {
  if (others.length === 0) return null;
  const bad = others.filter((drive) => drive.answer.verdict !== "passed" && drive.track.times.length > 0);
  const ends = bad.map(({ key, track }): [string, number, number] => [key.split("/").at(-1)!, track.x.at(-1)!, track.y.at(-1)!]);
  return (
    <p class="quiet" role="status">
      {PLAYER.others(others.length, ends)}
    </p>
  );
}

/** What is missing or cannot be read. */
function Lacks({ drives, names }: { drives: Drive[]; names: string[] }) {
  const told = useMemo(
    () => drives.flatMap((drive, i) => [...drive.remarks].map((remark) => (drives.length > 1 ? `${names[i]}: ${remark}` : remark))),
    [drives.map((drive) => drive.remarks.size).join()],
  );
  if (told.length === 0) return null;
  return (
    <div class="lacks" role="note">
      <strong>{PLAYER.missing}</strong>
      <ul>
        {told.map((remark) => (
          <li key={remark}>{remark}</li>
        ))}
      </ul>
    </div>
  );
}
