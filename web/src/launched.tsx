// What was started from here: that it runs, how far it is, what it prints, and how to stop it.
import { useEffect, useRef, useState } from "preact/hooks";
import { address, post, type Campaigns, type Launch, type Replay, type RunAnswer } from "./api";
import { isStale } from "./campaigns";
import { duration, moment } from "./format";
import { dismissLaunch, isRunning, tellLaunch, useAnswer, useLaunch, type Launched } from "./live";
import { useEnd } from "./log";
import { Export, State, VerdictBar } from "./parts";
import { link } from "./route";

const OUTCOMES: Record<number, string> = {
  0: "Every run passed.",
  1: "A run failed.",
  2: "It cannot be run as it was asked for.",
  3: "It cannot be run on this machine.",
  4: "A run ended without a verdict.",
  5: "Its results cannot be stored.",
  130: "It was stopped.",
};

/** Number of what was started in this tab and is to be brought into sight. */
let sought = 0;

/** Of a launch that reproduces a run. */
const REPLAY_OUTCOMES: Record<number, string> = {
  0: "The run ended as before.",
  1: "The run ended with another result.",
};

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
  launched: Launched;
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
    <section class="launch" aria-label="The campaign that was started here" ref={place}>
      <h2>
        {run && `${run} again${name && ": "}`}
        {!name && !run && "The campaign"}
        {name && (name === here ? "Further runs" : <a href={link(["campaign", name])}>{name}</a>)}{" "}
        {running && <State state="running" />}
      </h2>
      {summary && !(counted && name === here) && <VerdictBar summary={summary} />}
      <p class="tools">
        {running && (
          <button type="button" onClick={() => void post(address(["stop"]))}>
            {launch.stopping ? "Stop at once" : "Stop"}
          </button>
        )}
        <span role="status">{outcome(launch)}</span>
        <span class="quiet">
          {moment(launch.started)}
          {launch.ended !== null && `, took ${duration(launch.ended - launch.started)}`}
        </span>
        {name && name !== here && !running && (
          <a class="button" href={shownAt}>
            {run ? "Show the run" : "Show its runs"}
          </a>
        )}
        <Export name="output" rows={() => [["line"], ...lines.map((line) => [line])]} />
        {!running && (
          <button type="button" onClick={() => dismissLaunch(launch)}>
            Dismiss
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
    <p class={`replay ${same === false ? "error" : ""}`} aria-label="Comparison with the original">
      Replay of {stored ? <a href={link(["campaign", ...of.split("/")])}>{of}</a> : of}
      {text ? ": " : ", not compared with it."}
      <span class="lines">{text}</span>
    </p>
  );
}

/** Open, unless it had ended before one came here. */
function Output({ launched: { launch, first, lines } }: { launched: Launched }) {
  const [open] = useState(launch.ended === null);
  const end = useEnd(lines);
  return (
    <details open={open}>
      <summary>Output</summary>
      <div class="log output" {...end} tabIndex={0} role="region" aria-label="Output">
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
  if (ended === null && code !== null) return "The runs have ended; tables are being made.";
  if (ended === null) return stopping ? "It is being stopped: running scenarios end first." : "It is running.";
  return (run && REPLAY_OUTCOMES[code ?? 0]) || (OUTCOMES[code ?? 0] ?? `It broke off (exit code ${code}).`);
}
