// What was started from here: that it runs, how far it is, what it prints, and how to stop it.
import { useEffect, useRef, useState } from "preact/hooks";
import { address, post, type Campaigns, type Launch, type News, type Replay, type RunAnswer } from "./api";
import { isStale } from "./campaigns";
import { duration, moment } from "./format";
import { dismissLaunch, isRunning, tellLaunch, useAnswer, useLaunch } from "./live";
import { useEnd } from "./log";
import { Export, State, VerdictBar } from "./parts";
import { link } from "./route";
import { COMMON, LAUNCH } from "./text";

/** Number of what was started in this tab and is to be brought into sight. */
let sought = 0;



/** What starts something, whether that must wait, and why it was refused. */
export function useStarter(): { start: (url: string) => void; busy: boolean; refusal: string } {
  const busy = isRunning(useLaunch());
  const [refusal, setRefusal] = useState("");
  const start = (url: string) => {
    setRefusal("");
    const begun = (launch: Launch) => {
      sought = launch.number;
      tellLaunch(launch);
    };
    post<Launch>(url).then(begun, (cause: Error) => setRefusal(cause.message));
  };
  return { start, busy, refusal };
}

export function Refusal({ text }: { text: string }) {
  if (!text) return null;
  return (
    <p class="error" role="alert">
      {text}
    </p>
  );
}

/** What was started on a page of this campaign, if that was the last. */
export function StartedOn({ campaign, counted }: { campaign: string; counted?: boolean }) {
  const launched = useLaunch();
  if (launched?.launch.campaign !== campaign) return null;
  return <Progress key={launched.launch.number} {...{ launched, counted }} here={campaign} />;
}

interface ProgressProps {
  launched: News;
  /** The campaign on whose page it is shown. */
  here?: string;
  /** Whether that page counts the campaign's runs. */
  counted?: boolean;
}

/** The campaign that was started from here the last time. */
export function Progress({ launched, here, counted }: ProgressProps) {
  const { launch, lines } = launched;
  const { makes: name, run } = launch;
  const { data } = useAnswer<Campaigns>(address(["campaigns"]), isStale);
  const summary = name && data?.campaigns[name];
  const shownAt = link(["campaign", name, ...(run ? run.split("/") : [])]);
  const running = launch.ended === null;
  const place = useRef<HTMLElement>(null);
  useEffect(() => {
    if (sought !== launch.number) return;
    sought = 0;
    place.current?.scrollIntoView({ block: "center" });
  }, [launch.number]);
  return (
    <section class="launch" aria-label={LAUNCH.label} ref={place}>
      <h2>
        {run && `${LAUNCH.again(run)}${name && ": "}`}
        {!name && !run && LAUNCH.title}
        {name && (name === here ? LAUNCH.further : <a href={link(["campaign", name])}>{name}</a>)}{" "}
        {running && <State state="running" />}
      </h2>
      {summary && !(counted && name === here) && <VerdictBar summary={summary} />}
      <p class="tools">
        {running && (
          <button type="button" onClick={() => void post(address(["stop"]))}>
            {launch.stopping ? LAUNCH.stopNow : LAUNCH.stop}
          </button>
        )}
        <span role="status">{outcome(launch)}</span>
        <span class="quiet">
          {launch.ended === null ? moment(launch.started) : COMMON.took(moment(launch.started), duration(launch.ended - launch.started))}
        </span>
        {name && name !== here && !running && (
          <a class="button" href={shownAt}>
            {run ? LAUNCH.showRun : LAUNCH.showRuns}
          </a>
        )}
        <Export name="output" rows={() => [["line"], ...lines.map((line) => [line])]} />
        {!running && (
          <button type="button" onClick={() => dismissLaunch(launch)}>
            {LAUNCH.dismiss}
          </button>
        )}
      </p>
      <Refusal text={launch.error.replace(/^error: /, "")} />
      {run && name && !running && <Reproduced campaign={name} run={run} />}
      <Output launched={launched} />
    </section>
  );
}

/** How a run that was reproduced compares with the original. */
function Reproduced({ campaign, run }: { campaign: string; run: string }) {
  const { data } = useAnswer<RunAnswer>(address(["campaigns", campaign, ...run.split("/")]));
  return data?.details.replay && <ReplayText replay={data.details.replay} />;
}

/** The comparison of a replay with the run that it repeats, which it links to. */
export function ReplayText({ replay: { of, stored, same, text } }: { replay: Replay }) {
  return (
    <p class={`replay ${same === false ? "error" : ""}`} aria-label={LAUNCH.comparison}>
      {LAUNCH.replayOf} {stored ? <a href={link(["campaign", ...of.split("/")])}>{of}</a> : of}
      {text ? ": " : LAUNCH.notCompared}
      <span class="lines">{text}</span>
    </p>
  );
}

/** Open, unless it had ended before one came here. */
function Output({ launched: { launch, first, lines } }: { launched: News }) {
  const [open] = useState(launch.ended === null);
  const end = useEnd(lines);
  return (
    <details open={open}>
      <summary>{LAUNCH.output}</summary>
      <div class="log output" {...end} tabIndex={0} role="region" aria-label={LAUNCH.output}>
        <ol>
          <li class="debug">
            <span class="said">$ {launch.command}</span>
          </li>
          {lines.map((line, place) => (
            <li key={first + place} class={launch.error.split("\n").includes(line) ? "error" : undefined}>
              <span class="said">{line}</span>
            </li>
          ))}
        </ol>
      </div>
    </details>
  );
}

function outcome({ ended, code, stopping, run }: Launch): string {
  if (ended === null && code !== null) return LAUNCH.postprocessing;
  if (ended === null) return stopping ? LAUNCH.stopping : LAUNCH.running;
  return (run && LAUNCH.reproduced[code ?? 0]) || (LAUNCH.outcomes[code ?? 0] ?? LAUNCH.failed(code));
}
