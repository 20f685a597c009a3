// Running a campaign from here: what it would run, and what it says while it runs.
import { useEffect, useMemo, useState } from "preact/hooks";
import { address, post, type Campaigns, type Launch, type Offer } from "./api";
import { isStale } from "./campaigns";
import { factors, order, show } from "./data";
import { chosen, type Variants } from "./expansion";
import { duration, moment, plural } from "./format";
import { Grid } from "./grid";
import { isRunning, useAnswer, useLaunch, type Launched } from "./live";
import { useEnd } from "./log";
import { Export, Select, State, VerdictBar, Waiting } from "./parts";
import { choose, link } from "./route";

const RUNTIMES: [string, string][] = [
  ["", "the first that is here"],
  ["docker", "Docker"],
  ["podman", "Podman"],
  ["process", "plain processes"],
];
const OUTCOMES: Record<number, string> = {
  0: "Every run passed.",
  1: "A run failed.",
  2: "It cannot be run as it was asked for.",
  3: "It cannot be run on this machine.",
  4: "A run ended without a verdict.",
  5: "Its results cannot be stored.",
  130: "It was stopped.",
};

export function StartPage({ query }: { query: URLSearchParams }) {
  const { data: offer, error } = useAnswer<Offer>(address(["offer"]));
  const launched = useLaunch();
  if (!offer) return <Waiting error={error} title="Run a campaign" />;
  return (
    <>
      <div class="head">
        <h1>Run a campaign</h1>
        {offer.document ? (
          <p class="quiet">
            on this machine, of <code>{offer.document}</code>
          </p>
        ) : (
          <p class="hint">{offer.refusal}</p>
        )}
      </div>
      {offer.document && <Choices offer={offer} query={query} launched={launched} />}
    </>
  );
}

interface ChoicesProps {
  offer: Offer;
  query: URLSearchParams;
  launched: Launched | null;
}

function Choices({ offer, query, launched }: ChoicesProps) {
  const [variants, fault, readAgain] = useExpansion();
  const config = query.get("config") ?? "";
  const rows = useMemo(() => (variants ? chosen(variants, config) : []), [variants, config]);
  const runs = Number(query.get("runs")) || offer.runs;
  return (
    <>
      <div class="tools">
        <label class="choice">
          Configurations
          <input
            type="search"
            value={config}
            placeholder="all; or a name, or a glob as hall-*"
            onInput={(event) => choose({ config: event.currentTarget.value })}
          />
        </label>
        <Count label="Runs of each" name="runs" query={query} otherwise={String(offer.runs)} />
        <Count label="Side by side" name="jobs" query={query} otherwise="auto" />
        <Select
          label="Runtime"
          value={query.get("runtime") ?? ""}
          options={RUNTIMES}
          onChoose={(runtime) => choose({ runtime })}
        />
      </div>
      <Starter query={query} launched={launched} what={variants && `${plural(rows.length, "configuration")}, ${plural(rows.length * runs, "run")}`} />
      {launched && <Progress launched={launched} />}
      <h2>Configurations</h2>
      {fault && (
        <p class="error" role="alert">
          {fault}
        </p>
      )}
      {variants && <Expansion {...{ variants, rows, query }} />}
      {!variants && !fault && <p class="loading">The document is being expanded …</p>}
      {(variants || fault) && (
        <button type="button" onClick={readAgain}>
          Read the document again
        </button>
      )}
    </>
  );
}

/** The configurations, why there are none, and what asks for them again. */
function useExpansion(): [Variants | null, string, () => void] {
  const [variants, setVariants] = useState<Variants | null>(null);
  const [fault, setFault] = useState("");
  const read = () => {
    setVariants(null);
    setFault("");
    post<Variants>(address(["expansion"])).then(setVariants, (cause: Error) => setFault(cause.message));
  };
  useEffect(read, []);
  return [variants, fault, read];
}

interface CountProps {
  label: string;
  name: string;
  query: URLSearchParams;
  otherwise: string;
}

function Count({ label, name, query, otherwise }: CountProps) {
  return (
    <label class="choice">
      {label}
      <input
        type="number"
        min={1}
        max={999999}
        value={query.get(name) ?? ""}
        placeholder={otherwise}
        onInput={(event) => choose({ [name]: event.currentTarget.value })}
      />
    </label>
  );
}

interface StarterProps {
  query: URLSearchParams;
  launched: Launched | null;
  /** What would be run; null when that is not known. */
  what: string | null;
}

function Starter({ query, launched, what }: StarterProps) {
  const [refusal, setRefusal] = useState("");
  const [asked, setAsked] = useState(0);
  const busy = isRunning(launched) || asked > (launched?.launch.number ?? 0);
  const start = async () => {
    setRefusal("");
    try {
      setAsked((await post<Launch>(address(["start"], Object.fromEntries(query)))).number);
    } catch (cause) {
      setRefusal((cause as Error).message);
    }
  };
  return (
    <>
      <p class="tools">
        <button type="button" class="primary" disabled={busy} onClick={start}>
          Run
        </button>
        <span class="quiet" role="status">
          {busy ? "One campaign at a time can be run from here." : what}
        </span>
      </p>
      {refusal && (
        <p class="error" role="alert">
          {refusal}
        </p>
      )}
    </>
  );
}

/** The campaign that was started from here the last time. */
function Progress({ launched }: { launched: Launched }) {
  const { launch, lines } = launched;
  const { data } = useAnswer<Campaigns>(address(["campaigns"]), isStale);
  const name = Object.keys(data?.campaigns ?? {}).find((one) => lines.some((line) => line.includes(one)));
  const summary = name && data?.campaigns[name];
  const end = useEnd(lines);
  const saved = () => [["line"], ...lines.map((line) => [line])];
  return (
    <section class="launch" aria-label="The campaign that was started here">
      <h2>
        {name ? <a href={link(["campaign", name])}>{name}</a> : "The campaign"}{" "}
        {launch.ended === null && <State state="running" />}
      </h2>
      {summary && <VerdictBar summary={summary} />}
      <p class="tools">
        {launch.ended === null && (
          <button type="button" onClick={() => void post(address(["stop"]))}>
            {launch.stopping ? "Stop at once" : "Stop"}
          </button>
        )}
        <span role="status">{outcome(launch)}</span>
        <span class="quiet">
          {moment(launch.started)}
          {launch.ended !== null && `, took ${duration(launch.ended - launch.started)}`}
        </span>
        {name && launch.ended !== null && (
          <a class="button" href={link(["campaign", name])}>
            Show its runs
          </a>
        )}
        <Export name="output" rows={saved} />
      </p>
      <div class="log output" {...end} tabIndex={0} role="region" aria-label="Output">
        <ol>
          <li class="debug">
            <span class="said">$ {launch.command}</span>
          </li>
          {lines.map((line, place) => (
            <li key={launched.first + place} class={level(line)}>
              <span class="said">{line}</span>
            </li>
          ))}
        </ol>
      </div>
    </section>
  );
}

function outcome({ ended, code, stopping }: Launch): string {
  if (ended === null && code !== null) return "The runs have ended; tables are being made.";
  if (ended === null) return stopping ? "It is being stopped: running scenarios end first." : "It is running.";
  return OUTCOMES[code ?? 0] ?? `It broke off (exit code ${code}).`;
}

function level(line: string): string {
  if (/^error: |\] failed /.test(line)) return "error";
  return /^WARNING: |\] (errored|interrupted) /.test(line) ? "warn" : "";
}

interface ExpansionProps {
  variants: Variants;
  rows: number[];
  query: URLSearchParams;
}

function Expansion({ variants, rows, query }: ExpansionProps) {
  const names = useMemo(() => factors({ variants, factors: Object.keys(variants.values) }), [variants]);
  const sort = query.get("sort") ?? "";
  const column = (id: string) => (id === "name" ? variants.name : variants.values[id.slice(2)] ?? []);
  const shown = useMemo(() => {
    const keys = column(sort.replace(/^-/, ""));
    const sign = sort.startsWith("-") ? -1 : 1;
    return sort ? rows.toSorted((a, b) => sign * order(keys[a], keys[b])) : rows;
  }, [rows, sort]);
  const only = (row: number) => ({ ...Object.fromEntries(query), config: variants.name[row]! });
  if (!rows.length) return <p class="hint">No configuration has a name like that.</p>;
  return (
    <>
      <div class="tools">
        <Export
          name="configurations"
          rows={() => [
            ["name", ...names],
            ...shown.map((row) => [variants.name[row], ...names.map((name) => variants.values[name]![row])]),
          ]}
        />
      </div>
      <Grid
        label="Configurations"
        rows={shown}
        sort={sort}
        onSort={(next) => choose({ sort: next })}
        open={(row) => choose({ config: variants.name[row]! })}
        columns={[
          { id: "name", label: "Name", cell: (row) => <a href={link(["start"], only(row))}>{variants.name[row]}</a> },
          ...names.map((name) => ({
            id: `p:${name}`,
            label: name,
            kind: variants.values[name]!.some((one) => typeof one === "number") ? ("number" as const) : undefined,
            cell: (row: number) => show(variants.values[name]![row]),
          })),
        ]}
      />
    </>
  );
}
